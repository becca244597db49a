"""What the readers of logs share."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from altijax.formats.tables import (
    attitude_columns,
    from_first_imu_sample,
    import_extra,
    imu_table,
    rotations_of,
    stream_table,
)


def test_streams_share_the_imus_zero():
    imu = stream_table(np.array([100.0, 101.0]), np.zeros((2, 3)), ["ax", "ay", "az"], "a")
    gnss = stream_table(np.array([99.0, 102.0]), np.zeros((2, 1)), ["alt"], "b")
    tables = from_first_imu_sample({"gnss": gnss, "imu": imu})
    assert tables["imu"]["t"].tolist() == [0, 1] and tables["gnss"]["t"].tolist() == [-1, 2]
    assert from_first_imu_sample({"gnss": gnss})["gnss"]["t"].tolist() == [0, 3]


def test_a_gyro_is_read_at_the_accelerometers_times():
    problems, notes = [], []
    t = np.arange(5.0)
    t_gyro = np.arange(0.5, 5)
    table = imu_table((t, np.ones((5, 3))), (t_gyro, t_gyro[:, None] * [1, 2, 3]), "log", problems, notes)
    assert problems == [] and len(notes) == 1
    np.testing.assert_allclose(table[["t", "gx", "gy", "gz"]], t[1:, None] * [1, 1, 2, 3])
    assert "gx" not in imu_table((t, np.ones((5, 3))), None, "log", problems, notes)
    assert "there is no gyro" in problems[0]


def test_attitudes_of_quaternions():
    turn = Rotation.from_euler("ZYX", [0.3, -0.2, 0.1])
    C = rotations_of(np.stack([turn.as_quat(scalar_first=True), np.zeros(4), np.full(4, np.nan)]))
    assert np.isnan(C[1:]).all()
    found = attitude_columns(C[:1])
    np.testing.assert_allclose([found[k][0] for k in ("roll", "pitch", "heading")], [0.1, 0.2, np.pi / 2 - 0.3])


def test_a_missing_package_is_named(tmp_path):
    with pytest.raises(ModuleNotFoundError, match="reading it needs no_such_package"):
        import_extra("no_such_package", tmp_path / "a.log")
