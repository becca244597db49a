"""A stream in its final form: what is needed, what is turned and joined, what is left out."""

import numpy as np
import pandas as pd
import pytest

from altijax.formats.stream_checks import RecordingError
from altijax.formats.streams import final_stream


def table(**columns: object) -> pd.DataFrame:
    t = np.arange(0, 10, 0.1)
    made = pd.DataFrame({"t": t} | {name: np.broadcast_to(value, t.size) for name, value in columns.items()})
    made.attrs["file"] = "some.csv"
    made.attrs["lines"] = np.arange(2, 2 + t.size)
    return made


def final(stream: str, made: pd.DataFrame, axes: str = "FLU") -> tuple[pd.DataFrame | None, list[str]]:
    problems: list[str] = []
    return final_stream(stream, made, ("time",), axes, problems, [], {stream: made}), problems


def waves(scale: float, shift: float = 0.0) -> np.ndarray:
    return scale * np.sin(np.arange(100) * 0.37 + shift)


def test_sensor_axes_become_body_axes() -> None:
    made = table(ax=9.81 + waves(0.1), ay=waves(0.2), az=waves(0.3, 1.0))
    found, _ = final("imu", made, "UFL")
    assert found is not None and found.index.name == "t"
    np.testing.assert_allclose(found["az"], made["ax"])
    np.testing.assert_allclose(found["ax"], made["ay"])


def test_one_speed_is_the_mean_of_the_wheels() -> None:
    made = table(left=10 + waves(1), right=12 + waves(1, 0.3))
    found, _ = final("wheel", made)
    assert found is not None
    np.testing.assert_allclose(found["speed"], 0.5 * (made["left"] + made["right"]))


def test_a_course_becomes_a_velocity() -> None:
    found, _ = final("gnss", table(speed=10 + waves(1), course=90.0 + waves(5)))
    assert found is not None and list(found.columns) == ["v_e", "v_n", "v_u"]
    assert (found["v_e"] > 8).all() and found["v_n"].abs().max() < 1.5 and found["v_u"].isna().all()


def test_what_cannot_be_used_is_left_out_with_a_reason_but_the_imu_is_needed() -> None:
    found, problems = final("wheel", table(rpm=100.0))
    assert found is None and "needs the columns speed" in problems[0] and "left out" in problems[0]
    with pytest.raises(RecordingError, match="needs the columns ax and ay and az"):
        final("imu", table(ax=0.0))
