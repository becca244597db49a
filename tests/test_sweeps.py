"""Sweeps: every combination once, the same by any road, whatever fails or interrupts."""

from concurrent.futures import ThreadPoolExecutor

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest

from altijax.instruments import JA_5V, MEMS_ACCELEROMETER
from altijax.sweeps import _is_traceable, read_off, spaced_by_factors, sweep

GRID = {"a": [1.0, 2.0, 4.0], "b": [10.0, 20.0]}


def product(a: float, b: float) -> dict[str, float]:
    return {"product": a * b, "sum": a + b}


def noisy(a: float, b: float, key: jax.Array) -> jax.Array:
    return a + b * jax.random.normal(key)


def hosted(a: float, b: float, key: jax.Array) -> float:
    return float(noisy(a, b, key))


def test_every_combination_is_a_row_of_a_labelled_cube() -> None:
    found = sweep(product, GRID)
    assert found.index.names == ["a", "b"] and (found["reason"] == "").all()
    for (a, b), row in found.iterrows():
        assert row["product"] == a * b and row["sum"] == a + b
    cube = found.to_xarray()
    assert cube["product"].dims == ("a", "b") and float(cube["product"].sel(a=4.0, b=20.0)) == 80.0


@pytest.mark.parametrize("kind", [dict, pd.Series])
def test_numbers_mappings_and_series_may_be_returned(kind: type) -> None:
    found = sweep(lambda a: kind({"twice": 2 * float(a)}), {"a": np.arange(3)})
    assert found["twice"].tolist() == [0, 2, 4]
    assert sweep(lambda a: 2 * float(a), {"a": range(3)})["value"].tolist() == [0, 2, 4]


def test_all_roads_lead_to_the_same_numbers() -> None:
    options = dict(repeats=3, key=jax.random.key(5))
    at_once, small = (sweep(noisy, GRID, chunk=chunk, **options) for chunk in (None, 4))
    one_by_one = sweep(hosted, GRID, **options)
    with ThreadPoolExecutor(2) as executor:
        pooled = sweep(hosted, GRID, executor=executor, **options)
    pd.testing.assert_frame_equal(one_by_one, pooled)
    pd.testing.assert_frame_equal(at_once, small)
    pd.testing.assert_frame_equal(at_once, one_by_one, rtol=1e-6)


def test_mean_spread_and_standard_error_over_repeats() -> None:
    found = sweep(noisy, {"a": [0.0], "b": [1.0, 3.0]}, repeats=4)
    keys = [jax.random.fold_in(jax.random.key(0), repeat) for repeat in range(4)]
    drawn = np.array([float(jax.random.normal(key)) for key in keys])
    for b in (1.0, 3.0):
        row = found.loc[(0.0, b)]
        assert row["value"] == pytest.approx(b * drawn.mean(), rel=1e-5)
        assert row["value_std"] == pytest.approx(b * drawn.std(ddof=1), rel=1e-5)
        assert row["value_error"] == pytest.approx(row["value_std"] / 2) and row["runs"] == 4


def test_failures_are_rows_with_their_reason() -> None:
    def fails(a: float) -> float:
        if float(a) == 2:
            raise ArithmeticError("two is too much")
        return float(a)

    found = sweep(fails, {"a": [1, 2, 3]})
    assert found["reason"].tolist() == ["", "ArithmeticError: two is too much", ""]
    assert np.isnan(found.loc[2, "value"]) and found.loc[3, "value"] == 3


@pytest.mark.parametrize("after", [0, 1, 5])
def test_an_interrupted_sweep_goes_on_to_an_equal_result(after: int) -> None:
    whole = sweep(hosted, GRID, repeats=2)
    calls = []

    def interrupted(a: float, b: float, key: jax.Array) -> float:
        calls.append(float(a))
        if len(calls) == after + 1:
            raise KeyboardInterrupt
        return hosted(a, b, key)

    with pytest.warns(UserWarning, match=f"after {after // 2} of 6 combinations"):
        part = sweep(interrupted, GRID, repeats=2)
    assert (part["reason"] == "interrupted").sum() == 6 - after // 2
    calls.extend([0] * 20)
    calls_before = len(calls)
    pd.testing.assert_frame_equal(sweep(interrupted, part, repeats=2), whole)
    assert len(calls) - calls_before == 2 * (6 - after // 2)
    with pytest.raises(ValueError, match="the repeats and the key"):
        sweep(hosted, part, repeats=2, key=jax.random.key(1))


def test_records_go_by_their_labels() -> None:
    grid = {"sensor": {"JA-5V": JA_5V, "MEMS": MEMS_ACCELEROMETER}, "factor": [1.0, 2.0]}
    found = sweep(lambda sensor, factor: factor * sensor.noise_density, grid)
    assert found.loc[("MEMS", 2.0), "value"] == pytest.approx(2 * MEMS_ACCELEROMETER.noise_density)


def test_only_what_is_pure_is_traced() -> None:
    rng = np.random.default_rng(0)
    run = ({"a": np.float64(1)}, None)
    assert _is_traceable(lambda a: jnp.sin(a), *run)
    assert not _is_traceable(lambda a: a + rng.normal(), *run)
    assert not _is_traceable(lambda a: a + jnp.asarray(rng.normal(size=3)).sum(), *run)
    assert not _is_traceable(lambda a: 1.0 if a > 0 else 2.0, *run)
    assert len(set(sweep(lambda a: a + rng.normal(), {"a": [0.0, 0.0 + 1e-9]})["value"])) == 2


def test_what_a_sensor_must_be_is_read_off() -> None:
    x = np.geomspace(0.01, 10, 7)
    found = sweep(lambda noise, gain: gain * noise, {"noise": x, "gain": [1.0, 2.0, 1e4]})
    crossing = read_off(found, 1.0)
    # A power law is a straight line of logarithms.
    assert crossing.loc[1.0] == pytest.approx(1.0) and crossing.loc[2.0] == pytest.approx(0.5)
    assert np.isnan(crossing.loc[1e4])
    assert read_off(sweep(lambda a: 3 - 2 * a, {"a": [0.0, 1.0, 2.0]}), 2.0) == pytest.approx(0.5)
    assert spaced_by_factors(x) and not spaced_by_factors(np.linspace(0.01, 10, 7))


def test_what_cannot_be_swept_is_told() -> None:
    with pytest.raises(ValueError, match="must take a, c by name"):
        sweep(product, {"a": [1.0], "c": [1.0]})
    with pytest.raises(ValueError, match="different values"):
        sweep(product, {"a": [1.0, 1.0], "b": [1.0]})
    with pytest.raises(ValueError, match="an argument key"):
        sweep(product, GRID, repeats=2)
    assert "shape" in sweep(lambda a: np.array([float(a), 1.0]), {"a": [1.0]})["reason"].iloc[0]
