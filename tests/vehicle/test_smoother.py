"""One pass: gradients against differences, what it settles at, and outliers."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from altijax.vehicle.search import Search, _one as one, passed, said_between
from altijax.vehicle.sensors import layout_of
from tests.vehicle.made import USE, short_search


def pass_of(search: Search, levels: dict[str, float]) -> object:
    return jax.device_get(one(search, search.trajectory, search.delay, said_between(search), levels))


@pytest.mark.parametrize("name", ["rotation", "horizontal", "slip_time", "wheel_slip", "receiver_time", "force_error"])
def test_derivatives_by_levels_are_those_of_the_likelihood(name: str) -> None:
    search = short_search()
    level = search.levels[name]
    fit = pass_of(search, search.levels)
    ends = [pass_of(search, search.levels | {name: level * (1 + s)}).log_likelihood for s in (1e-4, -1e-4)]
    assert float(fit.by_level[name]) == pytest.approx((ends[0] - ends[1]) / (2e-4 * level), rel=1e-4, abs=1e-4)


def test_it_settles() -> None:
    search = passed(short_search(), 4)
    again = passed(search, 1)
    assert float(again.fit.step) < 1e-3
    assert np.abs(again.trajectory.x - search.trajectory.x).max() < 1e-2


def test_covariances_are_finite_and_positive() -> None:
    fit = short_search().fit
    assert np.isfinite(fit.covariance).all() and np.isfinite(fit.trajectory.x).all()
    assert np.linalg.eigvalsh(fit.covariance[::10]).min() > -1e-9


def test_an_outlier_is_trusted_less_and_named() -> None:
    search = short_search()
    velocity = search.rows["velocity"]
    k = np.flatnonzero(np.isfinite(velocity.std[:, 0]))[10]
    value = velocity.value.copy()
    value[k, 0] += 8.0
    off = passed(replace(search, rows=search.rows | {"velocity": replace(velocity, value=value)}), 2)
    assert abs(off.fit.surprise["velocity"][k, 0]) > 20
    assert off.fit.doubt["velocity"][k, 0] > 100
    told = passed(replace(off, doubt=off.fit.doubt), 6)
    place = layout_of(USE).at("velocity").start
    apart = np.abs(told.trajectory.x[:, place] - search.trajectory.x[:, place])
    assert apart.max() < 0.2
