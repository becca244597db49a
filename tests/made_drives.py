"""Recordings made up for tests."""

import numpy as np
import pandas as pd

from altijax.recordings import Recording


def curvy_recording() -> Recording:
    """Forty seconds of S-curves on a level road, the wheels as aid; it starts at 5 s and its IMU is biased."""
    rng = np.random.default_rng(1)
    t = np.arange(0, 40, 0.02)
    speed, rate = 10 + 3 * np.sin(0.25 * t), 0.4 * np.cos(0.35 * t)
    readings = {
        "ax": 0.75 * np.cos(0.25 * t) + 0.1,
        "ay": speed * rate - 0.05,
        "az": np.full(t.size, 9.81),
        "gx": np.zeros(t.size),
        "gy": np.full(t.size, 0.003),
        "gz": rate - 0.002,
    }
    scatter = {"a": 0.05, "g": 0.002}
    imu = {name: x + scatter[name[0]] * rng.normal(size=t.size) for name, x in readings.items()}
    index = pd.Index(t + 5, name="t")
    wheel = pd.DataFrame({"speed": speed[::5] + 0.02 * rng.normal(size=t[::5].size)}, index=index[::5])
    return Recording(name="made", imu=pd.DataFrame(imu, index=index), wheel=wheel)
