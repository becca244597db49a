#!/usr/bin/env bash
# SciPy's Rotation.from_euler about one axis: a one-dimensional array of N angles was N rotations up to 1.16, as its
# docstring said. From 1.17 on it raises for N > 1, and an array of one angle is a single rotation where it was a stack of
# one: what indexes or counts the result breaks only for recordings with one epoch. (N, 1) means the same in both.
# The change is deliberate, of consistent shapes; AltiJAX gives angles with as many columns as there are axes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/shapes.py" <<'PY'
import numpy as np
import scipy
from scipy.spatial.transform import Rotation


def shape(*size):
    try:
        return Rotation.from_euler("z", np.zeros(size)).as_quat().shape
    except ValueError as error:
        return str(error)


found = {size: shape(*size) for size in ((3,), (1,), (3, 1))}
print("scipy", scipy.__version__, found)
old = scipy.__version__.startswith("1.16")
assert found[3, 1] == (3, 4), "the behaviour has changed"
assert found[(1,)] == ((1, 4) if old else (4,)), "the behaviour has changed"
assert (found[(3,)] == (3, 4)) if old else ("last dimension" in found[(3,)]), "the behaviour has changed"
PY
for version in 1.16.3 1.17.1; do
    python3 -m venv "$folder/$version"
    "$folder/$version/bin/pip" install --quiet --disable-pip-version-check "scipy==$version"
    "$folder/$version/bin/python" "$folder/shapes.py"
done
