"""The known degeneracies are found and named, and what is said agrees with linear algebra done another way."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from altijax.altitude import elevation_by_norm, elevation_by_slope
from altijax.calibration.identifiability import describe_undetermined, identify, identify_information, information_gain
from altijax.rotations import euler_to_matrix

T = jnp.linspace(0, 60, 301)
SPEED = 10 + 3 * jnp.sin(0.3 * T)
PITCH = 0.03 * jnp.sin(0.2 * T)
F_B = jnp.stack([0.9 * jnp.cos(0.3 * T) + 9.8 * jnp.sin(PITCH), 0 * T, 9.8 * jnp.cos(PITCH)], -1)


def by_slope(x: jax.Array) -> jax.Array:
    bias, mounting = x
    turn = euler_to_matrix(jnp.stack([0 * mounting, mounting, 0 * mounting]))
    f_x = ((F_B - jnp.stack([bias, 0 * bias, 0 * bias])) @ turn.T)[:, 0]
    return elevation_by_slope(T, f_x, SPEED, 9.8)[0] / 0.5


def by_norm(x: jax.Array) -> jax.Array:
    bias, scale, gravity = x
    f_b = (F_B / scale).at[:, 2].add(-bias)
    return elevation_by_norm(T, f_b, SPEED, 0 * T, gravity, 0.3)[0] / 0.5


def test_slope_mixes_forward_bias_and_mounting_pitch() -> None:
    found = identify(
        jax.jacfwd(by_slope)(jnp.zeros(2)), jnp.array([0.3, 0.05]), ("accelerometer_bias_x", "mounting_pitch")
    )
    (sentence,) = describe_undetermined(found)
    assert sentence.startswith("accelerometer_bias_x and mounting_pitch cannot be told apart here; ")
    weight = float(sentence.split(" mounting_pitch can:")[0].split()[-1])
    assert weight == pytest.approx(9.8, rel=0.01)
    assert sentence in str(found) and found.rank == 1
    # known together far better than each
    assert float(sentence.split("std ")[1].rstrip(".")) < 0.02 < found.std[0]
    assert np.all(found.gained >= 0) and found.correlation[0, 1] ** 2 > 0.99


def test_elevation_mixes_vertical_bias_scale_and_gravity() -> None:
    names = ("accelerometer_bias_z", "accelerometer_scale", "gravity")
    jacobian = jax.jacfwd(by_norm)(jnp.array([0.0, 1.0, 9.8]))
    found = identify(jacobian, jnp.array([0.3, 0.01, 0.05]), names)
    (sentence,) = describe_undetermined(found)
    assert all(name in sentence for name in names) and found.rank == 1
    assert "accelerometer_bias_z + 9.8" in sentence and "+ gravity" in sentence


def test_all_is_said_to_be_determined_where_it_is() -> None:
    found = identify(jnp.array([[10.0, 0], [0, 300.0], [1, 1]]), jnp.array([1.0, 0.1]), ("a", "b"))
    assert describe_undetermined(found) == [] and found.rank == 2


def test_a_parameter_without_effect_is_named_alone() -> None:
    found = identify(jnp.array([[10.0, 0], [20.0, 0]]), jnp.array([1.0, 0.1]), ("a", "b"))
    assert describe_undetermined(found) == ["The data say less of b than was known before."]
    assert found.std[1] == pytest.approx(0.1) and found.gained[1] == pytest.approx(0)
    assert found.data_covariance[1, 1] > 1e8


def test_numbers_are_those_of_plain_linear_algebra() -> None:
    jacobian = np.random.default_rng(0).normal(size=(20, 5)) * [1, 3, 0.1, 10, 1]
    prior = np.array([1.0, 0.2, 3.0, 0.01, 1e3])
    found = identify(jacobian, prior, tuple("abcde"))
    information = jacobian.T @ jacobian
    np.testing.assert_allclose(found.covariance, np.linalg.inv(information + np.diag(prior**-2.0)), rtol=1e-7)
    np.testing.assert_allclose(found.data_covariance, np.linalg.inv(information), rtol=1e-6)
    gain = 0.5 * np.log2(np.linalg.det(np.eye(5) + prior[:, None] * information * prior))
    assert information_gain(jacobian, prior) == pytest.approx(gain)
    # gradients exist where directions are degenerate
    slope = jax.grad(lambda j: information_gain(j, prior))(jnp.zeros((20, 5)))
    assert np.isfinite(slope).all()
    again = identify_information(information, prior, tuple("abcde"))
    np.testing.assert_allclose(again.std, found.std, rtol=1e-9)


def test_names_must_fit() -> None:
    with pytest.raises(ValueError, match="names must be 2 different ones"):
        identify(jnp.eye(2), jnp.ones(2), ("a", "a"))
