"""Starts are near enough to the truth for the passes to end there."""

from dataclasses import replace

import numpy as np
import pytest

from altijax.datasets import load_dataset
from altijax.vehicle.beliefs import belief_of
from altijax.vehicle.search import begun
from altijax.vehicle.sensors import layout_of
from altijax.vehicle.start import receiver_delay


@pytest.mark.parametrize("use", [("gyro", "velocity", "course"), ("velocity", "course"), ("gyro", "wheel", "course")])
def test_a_start_has_the_drive_in_outline(use: tuple[str, ...]) -> None:
    recording = load_dataset("hill-road")
    search = begun(recording, use, 0.1, belief_of(use), [])
    x = layout_of(use).split(search.trajectory.x)
    way = x["way"][-1]
    reference = recording.reference[["v_e", "v_n", "v_u"]]
    true = np.trapezoid(np.sqrt((reference**2).sum(axis=1)), reference.index)
    assert way == pytest.approx(true, rel=0.03)
    pitch = np.arcsin(search.trajectory.C_nb[:, 2, 0])
    assert np.abs(pitch).max() < 0.4


def test_the_delay_of_a_receiver_is_found_from_its_velocities() -> None:
    recording = load_dataset("hill-road")
    moved = replace(recording, gnss=recording.gnss.set_axis(recording.gnss.index + 0.3))
    assert receiver_delay(moved) - receiver_delay(recording) == pytest.approx(0.3, abs=0.1)
