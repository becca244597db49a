"""The shipped recording is the one that its script makes."""

from importlib import resources

import numpy as np
import pandas as pd
import pytest

from altijax.samples.make_hill_road import write

pytestmark = pytest.mark.slow


def test_the_script_makes_what_is_shipped(tmp_path) -> None:
    write(tmp_path)
    shipped = resources.files("altijax") / "samples" / "hill-road"
    assert (tmp_path / "recording.toml").read_text() == (shipped / "recording.toml").read_text()
    for name in ("imu", "pulses", "gnss", "reference"):
        made, kept = (pd.read_csv(folder / f"{name}.csv.gz") for folder in (tmp_path, shipped))
        assert list(made) == list(kept) and len(made) == len(kept)
        numbers = made.select_dtypes("number").columns
        # another processor may round the last digit of a file another way, which has four places or more
        np.testing.assert_allclose(made[numbers], kept[numbers], rtol=0, atol=0.011 if name == "gnss" else 1.1e-4)
