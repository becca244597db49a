"""The outage protocol: what it counts, what it measures, and what it must not see."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from altijax.recordings import Recording
from altijax.speed_estimate import estimates as speed_estimates
from altijax.speed_estimate.estimates import SPEED_METHODS, estimate_speed
from altijax.speed_estimate.outages import outage_errors, outage_table
from tests.made_drives import curvy_recording

ARGUMENTS = (("conventional", "filter"), (5.0, 15.0), 10.0)


@pytest.fixture(scope="module")
def drive() -> Recording:
    return curvy_recording()


@pytest.fixture(autouse=True)
def nominal_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fitting the noise levels is for test_speed_estimates."""
    monkeypatch.setattr(speed_estimates, "_FIT_FROM", np.inf)


def test_the_outage_table_counts_and_measures(drive: Recording) -> None:
    table = outage_table(drive, *ARGUMENTS, first=14.0)
    errors = outage_errors(drive, *ARGUMENTS, first=14.0)
    assert table.loc[("filter", 5.0, "all"), "windows"] == 3 and table.loc[("filter", 15.0, "all"), "windows"] == 2
    group = errors[(errors["method"] == "filter") & (errors["duration"] == 5.0)]
    assert list(group["start"]) == [19.0, 29.0, 39.0]
    assert table.loc[("filter", 5.0, "all"), "rms"] == pytest.approx(np.sqrt(np.mean(group["error"] ** 2)))
    alone = estimate_speed(drive, aid_until=19.0)
    assert group["error"].iloc[0] == pytest.approx(
        np.interp(24.0, alone.index, alone["speed"]) - np.interp(24.0, drive.wheel.index, drive.wheel["speed"])
    )
    turned = np.trapezoid(np.abs(0.4 * np.cos(0.35 * np.linspace(14, 19, 500))), dx=5 / 499)
    assert group["turning"].iloc[0] == pytest.approx(turned, abs=0.03)
    bins = table.drop("all", level="turning")["windows"].groupby(["method", "duration"]).sum()
    assert (bins == table.xs("all", level="turning")["windows"]).all()


@pytest.mark.parametrize("method", SPEED_METHODS)
def test_each_outage_is_an_estimate_by_itself(drive: Recording, method: str) -> None:
    """Whatever the runs of one table share."""
    errors = outage_errors(drive, (method,), (7.0,), 5.0, first=14.0)
    assert len(errors) == 4
    for row in errors.itertuples():
        end = row.start + row.duration
        alone = estimate_speed(drive, method=method, aid_until=row.start)
        truth = np.interp(end, drive.wheel.index, drive.wheel["speed"])
        assert row.error == pytest.approx(np.interp(end, alone.index, alone["speed"]) - truth, abs=1e-10)
        assert row.std == pytest.approx(np.interp(end, alone.index, alone["speed_std"]), rel=1e-10)


def test_the_aid_after_an_outage_began_only_scores(drive: Recording) -> None:
    """Garbage in the aid after the start of the last outage changes its errors by what the truth changed."""
    assert drive.wheel is not None
    speeds = drive.wheel["speed"].to_numpy()
    truth = pd.DataFrame({"v_e": speeds, "v_n": 0 * speeds}, index=drive.wheel.index)
    wheel = drive.wheel.copy()
    later = wheel.index > 5.0 + 24.0
    wheel.loc[later, "speed"] = np.random.default_rng(3).uniform(0, 90, later.sum())
    arguments = (("roll", "filter"), (5.0,), 10.0)
    clean = outage_errors(replace(drive, reference=truth), *arguments, first=14.0)
    spoiled = outage_errors(replace(drive, reference=truth, wheel=wheel), *arguments, first=14.0)
    early = clean["start"] <= 5.0 + 24.0
    pd.testing.assert_frame_equal(spoiled[early], clean[early], check_exact=True)
    assert not np.allclose(spoiled[~early]["error"], clean[~early]["error"])


def test_a_drive_whose_aid_begins_late_counts_from_there(drive: Recording) -> None:
    """A receiver that needs some seconds for its first fix."""
    late = replace(drive, wheel=drive.wheel[8.0:])
    errors = outage_errors(late, ("filter",), (5.0,), 10.0, first=14.0)
    assert list(errors["start"]) == [pytest.approx(start, abs=0.03) for start in (22.0, 32.0)]
    assert errors["error"].abs().max() < 3.0
    with pytest.raises(ValueError, match="within the time of its IMU"):
        outage_errors(replace(drive, wheel=drive.wheel.set_index(drive.wheel.index + 900.0)), ("filter",))


def test_wrong_options_are_named(drive: Recording) -> None:
    with pytest.raises(ValueError, match="method must be one of conventional"):
        outage_table(drive, ("filter", "magic"))
    with pytest.raises(ValueError, match="sensors must be one of auto"):
        outage_table(drive, ("filter:7",))
    with pytest.raises(ValueError, match="has no outage of"):
        outage_table(drive, first=39.0)
