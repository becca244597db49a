"""Scores of motion estimates of which the errors are known."""

import numpy as np
import pandas as pd
import pytest

from altijax.motion_estimate.scores import score_motion, withheld_gnss_errors
from altijax.recordings import Recording

T = np.arange(0, 10, 0.1)


def estimate() -> pd.DataFrame:
    columns = {
        "roll": 0.1,
        "pitch": -0.2,
        "heading": np.mod(6.2 + 0.02 * T, 2 * np.pi),
        "v_e": T,
        "v_n": 1.0,
        "v_u": 0.0,
    }
    columns |= {f"{name}_std": 0.02 for name in ("roll", "pitch", "heading", "v_e", "v_n", "v_u")}
    return pd.DataFrame(columns, index=T).assign(valid=T < 8)


def test_errors_are_found_across_north_and_where_valid_only() -> None:
    truth = estimate()
    reference = pd.DataFrame(
        {
            "roll": 0.1 + 0.01,
            "pitch": -0.2,
            "heading": np.mod(truth["heading"] - 0.03, 2 * np.pi),
            "v_e": T + 3.0,
            "v_n": 1.0 - 4.0,
            "v_u": np.where(T < 8, 0.0, 99.0),
        },
        index=T,
    )
    score = score_motion(truth, Recording(reference=reference))
    assert score.loc["roll", "mean"] == pytest.approx(-0.01)
    assert score.loc["pitch", "rms"] == pytest.approx(0, abs=1e-12)
    assert score.loc["heading", "rms"] == pytest.approx(0.03)
    assert score.loc["heading", "within_1_std"] == 0 and score.loc["heading", "within_2_std"] == 1
    assert score.loc["velocity", "rms"] == pytest.approx(5.0)
    assert score.loc["v_u", "samples"] == 80


def test_what_is_missing_is_named() -> None:
    with pytest.raises(ValueError, match="'x' has no reference"):
        score_motion(estimate(), Recording(name="x"))
    with pytest.raises(ValueError, match="'x' has no GNSS velocities to withhold"):
        withheld_gnss_errors(Recording(name="x"))
