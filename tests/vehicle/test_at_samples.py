"""Between instants the motion goes on as the readings say, and its errors grow."""

import numpy as np

from altijax.vehicle.at_samples import as_table, at_samples
from altijax.vehicle.search import said_between
from altijax.vehicle.sensors import layout_of
from tests.vehicle.made import USE, short_drive, short_search


def samples() -> object:
    search = short_search()
    return at_samples(
        short_drive(), layout_of(USE), search.trajectory, search.fit.covariance, said_between(search), search.levels
    )


def test_positions_are_the_integral_of_velocities() -> None:
    found = samples()
    steps = 0.5 * (found.v_n[1:] + found.v_n[:-1]) * np.diff(found.t)[:, None]
    drift = found.p_n[1:] - found.p_n[:1] - np.cumsum(steps, 0)
    assert np.abs(drift).max() < 0.05


def test_attitudes_turn_and_covariances_are_positive() -> None:
    found = samples()
    eye = found.C_nb @ np.swapaxes(found.C_nb, -1, -2)
    np.testing.assert_allclose(eye, np.broadcast_to(np.eye(3), eye.shape), atol=1e-9)
    assert np.linalg.eigvalsh(found.covariance[::50]).min() > -1e-9


def test_the_table_has_a_bar_for_every_column() -> None:
    table = as_table(short_drive(), samples())
    assert table.index.equals(short_drive().imu.index)
    names = [name for name in table if not name.endswith("_std")]
    assert {f"{name}_std" for name in names} == set(table) - set(names)
    assert np.isfinite(table.to_numpy(float)).all()
    np.testing.assert_allclose(table["speed"], np.linalg.norm(table[["v_e", "v_n", "v_u"]], axis=1))
