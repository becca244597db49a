"""Velocities against positions: all eight ways to exchange and reverse two components."""

import numpy as np
import pytest

from altijax.agreement.pairs import STEP, Pair
from altijax.agreement.velocities import judge_velocity, velocity_match

KEY = ("velocity and positions", "gnss")


def found(v_e, v_n, moved):
    pair = Pair(name=KEY[0], first="gnss", second="gnss", others=(v_e + 1j * v_n)[None], series=moved)
    return list(judge_velocity(KEY, velocity_match(pair)))


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (lambda e, n: (e, n), None),
        (lambda e, n: (-e, n), "v_e has the other sign"),
        (lambda e, n: (e, -n), "v_n has the other sign"),
        (lambda e, n: (n, e), "v_e and v_n are exchanged"),
        (lambda e, n: (-e, -n), "v_e and v_n have the other sign"),
        (lambda e, n: (-n, -e), "exchanged, and have the other sign"),
        (lambda e, n: (n, -e), "v_e is"),
        (lambda e, n: (-n, e), "v_e is"),
    ],
)
def test_every_mirror_and_turn_is_named(change, cause):
    angle = np.linspace(0, 5, 400)
    moved = 100 * np.exp(1j * angle) + np.random.default_rng(0).normal(size=400)
    told = found(*change(moved.real, moved.imag), moved)
    assert (told == []) if cause is None else (len(told) == 1 and cause in told[0].cause and told[0].verdict == "wrong")


def test_at_rest_and_in_short_records_nothing_is_told():
    jitter = np.random.default_rng(1).normal(size=(4, 200))
    assert found(jitter[0], jitter[1], jitter[2] + 1j * jitter[3]) == []
    moved = 100 * np.exp(1j * np.linspace(0, 5, round(8 / STEP)))
    assert found(-moved.real, moved.imag, moved) == []
