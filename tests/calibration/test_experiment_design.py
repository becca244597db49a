"""The planned information is that of a differenced plan, and the advice is what the physics asks for."""

import jax
import numpy as np
import pytest

from altijax.calibration.drive_model import DRIVE_PARAMETERS
from altijax.calibration.experiment_design import CHANGES, driving_protocol, manoeuvre_gains
from altijax.calibration.simulated_drives import Manoeuvres

NAMES, ROWS = list(DRIVE_PARAMETERS), list(CHANGES)
gains = jax.jit(manoeuvre_gains)
STRAIGHT = Manoeuvres(turning=0.05, slope=0.0)


@pytest.mark.slow
def test_gradient_is_that_of_differences() -> None:
    bits, added = gains(Manoeuvres())
    step = 1e-3
    up, down = (gains(Manoeuvres(turning=0.9 + s))[0] for s in (step, -step))
    np.testing.assert_allclose(
        added[ROWS.index("turning")], (up - down) / (2 * step) * CHANGES["turning"][0], rtol=1e-3, atol=1e-4
    )
    assert np.all(bits > 0)


def test_straight_road_asks_for_turns() -> None:
    bits, added = gains(STRAIGHT)
    turning = gains(Manoeuvres())[0]
    column = NAMES.index("accelerometer_bias_x")
    assert turning[column] > bits[column] + 1
    said = driving_protocol(bits, added, ("accelerometer_bias_x", "accelerometer_bias_y"))
    assert "accelerometer_bias_y" in said.splitlines()[1]
    assert said.splitlines()[-1].startswith("In this order: take roads that turn 0.2 rad further")
