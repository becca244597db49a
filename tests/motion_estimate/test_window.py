"""Windows of epochs: velocities between the epochs are led by the readings and end at what was measured."""

import numpy as np
import pytest

from altijax.motion_estimate.estimates import estimate_motion
from tests.vehicle.made import short_drive


@pytest.mark.parametrize("use_gyro", [True, False])
def test_velocities_meet_those_measured(use_gyro: bool) -> None:
    recording = short_drive()
    estimate = estimate_motion(recording, method="window", use_gyro=use_gyro, delay=0.1)
    epochs = recording.gnss.index[2:-2]
    for name in ("v_e", "v_n", "v_u"):
        at = np.interp(epochs - 0.1, estimate.index, estimate[name])
        np.testing.assert_allclose(at, recording.gnss[name].loc[epochs], atol=0.1)
