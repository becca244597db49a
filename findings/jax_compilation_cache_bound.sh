#!/usr/bin/env bash
# JAX's persistent compilation cache: once a folder was filled without a bound on its size (the default), setting
# jax_compilation_cache_max_size on it stops all writing. JAX looks for the time of last use of every entry, which only
# a bounded cache writes, and warns at each compilation instead of keeping anything; programs already there are loaded.
# AltiJAX bounds its cache, as JAX locks a bounded one only, and so takes a subfolder that nothing else writes to.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check jax==0.10.2 jaxlib==0.10.2 filelock==4.3.1
cat > "$folder/compile.py" <<'PY'
import sys
import warnings
import jax
import jax.numpy as jnp

cache, bound, factor = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
jax.config.update("jax_compilation_cache_dir", cache)
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
jax.config.update("jax_compilation_cache_max_size", bound)
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    jax.jit(lambda x: jnp.sin(x) * factor)(jnp.arange(3.0))
print(sum("Error writing persistent compilation cache" in str(w.message) for w in caught))
PY
"$folder/env/bin/python" - "$folder" <<'PY'
import pathlib
import subprocess
import sys
from importlib.metadata import version

folder = pathlib.Path(sys.argv[1])


def compiled(cache, bound, factor):
    """Complaints of a process that compiles one new program, and the entries there afterwards."""
    command = [sys.executable, folder / "compile.py", folder / cache, str(bound), str(factor)]
    complaints = int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return complaints, len(list((folder / cache).glob("*-cache")))


print("jax", version("jax"), "filelock", version("filelock"))
complaints, before = compiled("mixed", -1, 2.0)
assert complaints == 0 and before > 0
print("without a bound:", before, "entries written, no complaint")
complaints, after = compiled("mixed", 2**30, 3.0)
print("then bounded to 1 GiB: entries", before, "->", after, "and", complaints, "warning(s) that a file is missing")
alone, entries = compiled("bounded", 2**30, 3.0)
print("a folder bounded from the start:", entries, "entries written,", alone, "warnings")
assert (complaints > 0, after == before, alone, entries > 0) == (True, True, 0, True), "the behaviour has changed"
PY
