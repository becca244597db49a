"""The Earth against boule (normal gravity) and pymap3d (coordinates)."""

import boule
import jax
import numpy as np
import pymap3d
import pytest

from altijax import earth

LATITUDES = np.radians([-90.0, -89.9999, -45.0, 0.0, 1e-7, 37.7, 66.0, 90.0])
HEIGHTS = np.array([-400.0, 0.0, 30.0, 1600.0, 9000.0])
GEODETIC = np.stack(np.meshgrid(LATITUDES, np.radians([-180.0, -122.4, 0.0, 13.7, 179.0]), HEIGHTS), -1).reshape(-1, 3)


def test_normal_gravity_is_boules() -> None:
    latitude, height = np.meshgrid(LATITUDES, [0.0, 30.0, 1600.0, 9000.0])
    expected = boule.WGS84.normal_gravity((0, np.degrees(latitude), height), si_units=True)
    # boule is exact; the series in height leaves out its third order, 4 (h/a)^3 g = 1e-7 m/s^2 at 9 km, and more near
    # it
    np.testing.assert_allclose(earth.normal_gravity(latitude, height), expected, rtol=0, atol=1e-6)
    np.testing.assert_allclose(earth.normal_gravity(LATITUDES, 0.0), expected[0], rtol=0, atol=2e-9)


def test_ecef_is_pymap3ds() -> None:
    expected = np.stack(pymap3d.geodetic2ecef(*GEODETIC.T, deg=False), -1)
    np.testing.assert_allclose(earth.geodetic_to_ecef(GEODETIC), expected, rtol=0, atol=1e-8)


def test_geodetic_round_trip() -> None:
    back = np.asarray(earth.ecef_to_geodetic(earth.geodetic_to_ecef(GEODETIC)))
    radius = 6.4e6
    np.testing.assert_allclose(back[:, 2], GEODETIC[:, 2], rtol=0, atol=1e-8)
    np.testing.assert_allclose(radius * back[:, 0], radius * GEODETIC[:, 0], rtol=0, atol=1e-8)
    east = radius * np.cos(GEODETIC[:, 0]) * np.sin(back[:, 1] - GEODETIC[:, 1])
    np.testing.assert_allclose(east, 0, rtol=0, atol=1e-8)


def test_far_above_the_ellipsoid() -> None:
    geodetic = np.array([[0.3, 1.0, 1e6], [-1.2, 2.0, -1e4]])
    back = np.asarray(earth.ecef_to_geodetic(earth.geodetic_to_ecef(geodetic)))
    np.testing.assert_allclose(back * [6.4e6, 6.4e6, 1], geodetic * [6.4e6, 6.4e6, 1], rtol=0, atol=1e-8)


def test_enu_is_pymap3ds_and_inverts() -> None:
    origin = np.radians([40.0966, -105.1474, 0]) + np.array([0, 0, 1601.0])
    rng = np.random.default_rng(0)
    geodetic = origin + rng.normal(size=(7, 3)) * [1e-3, 1e-3, 100]
    expected = np.stack(pymap3d.geodetic2enu(*geodetic.T, *origin, deg=False), -1)
    enu = earth.geodetic_to_enu(geodetic, origin)
    metres = np.array([6.4e6, 6.4e6, 1])
    np.testing.assert_allclose(enu, expected, rtol=0, atol=2e-8)
    np.testing.assert_allclose(
        np.asarray(earth.enu_to_geodetic(enu, origin)) * metres, geodetic * metres, rtol=0, atol=1e-7
    )


def test_axes_at_the_equator_and_meridian() -> None:
    np.testing.assert_allclose(earth.enu_axes([0.0, 0.0, 5.0]), [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-15)


@pytest.mark.parametrize("point", [[0.0, 0.0, 6356752.314245], [6378137.0, 0.0, 0.0], [0.0, -6378137.0, 0.0]])
def test_derivatives_are_finite_at_poles_and_axes(point: list[float]) -> None:
    assert np.isfinite(jax.jacrev(earth.ecef_to_geodetic)(np.array(point))).all()
    assert np.isfinite(jax.jacfwd(earth.ecef_to_geodetic)(np.array(point))).all()
