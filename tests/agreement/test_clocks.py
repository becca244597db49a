"""Offsets of every clock, and drifts, named with the stream and the seconds."""

import re

import pytest

from altijax.agreement.clocks import LARGEST_DELAY, drift, judge_clocks
from altijax.agreement.report import agreement_report
from tests.agreement.drives import late, streams


@pytest.mark.parametrize("stream", ["imu", "wheel", "gnss"])
@pytest.mark.parametrize("seconds", [-60.0, -37.0, -3.0, 4.0, 18.0])
def test_an_offset_is_found_in_the_stream_that_has_it(stream, seconds):
    _, found = agreement_report(late(streams(), stream, seconds))
    assert [finding.stream for finding in found] == [stream] and found[0].verdict == "wrong"
    mending = float(re.search(rf"clock={{'{stream}': (.*?)}}", found[0].remedy).group(1))
    assert mending == pytest.approx(-seconds, abs=0.4)
    assert ("leap seconds" in found[0].cause) == (seconds in (18.0, -37.0))


def test_delays_of_receivers_are_no_fault():
    report, found = agreement_report(late(streams(), "gnss", 0.9))
    assert found == [] and report["offset"].dropna().max() < LARGEST_DELAY


def test_a_clock_that_runs_away_is_told():
    _, found = agreement_report(late(streams(), "gnss", 0.0, 1.02))
    assert [finding.stream for finding in found] == ["gnss"]
    assert "runs" in found[0].cause and "% slow" in found[0].cause and found[0].verdict == "doubtful"


def test_nothing_to_compare_tells_nothing():
    assert list(judge_clocks({})) == []
    assert drift(type("Found", (), {"lags": []})())[0] == 0
