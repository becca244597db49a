"""AiM's CSV export of Race Studio, in quotes and without."""

import numpy as np
import pytest

from altijax.recordings import RecordingError, RecordingWarning, read_recording

GPS = {
    "GPS Speed": ("km/h", lambda k: 36.0 + k),
    "GPS Nsat": ("", lambda k: 13),
    "GPS Heading": ("deg", lambda k: 90.0),
    "GPS Altitude": ("m", lambda k: 157.0 + k),
    "GPS SpdAccuracy": ("km/h", lambda k: 0.36),
    "GPS Latitude": ("deg", lambda k: 45.5),
    "GPS Longitude": ("deg", lambda k: 10.0),
}
IMU = {
    "InlineAcc": ("g", lambda k: 0.1),
    "LateralAcc": ("g", lambda k: 0.0),
    "VerticalAcc": ("g", lambda k: 1.0),
    "RollRate": ("deg/s", lambda k: 0.0),
    "PitchRate": ("deg/s", lambda k: 0.0),
    "YawRate": ("deg/s", lambda k: float(k)),
}


def write(path, channels, quote=""):
    channels = {"Time": ("s", lambda k: 0.05 * k)} | channels
    width = len(channels)

    def line(*cells):
        return ",".join([f"{quote}{cell}{quote}" for cell in cells] + [""] * (width - len(cells)))

    lines = [
        line("Format", "AiM CSV File"),
        line("Date", "Sunday"),
        line("Beacon Markers", 62.774, 117.713, 171.05),
        line("Segment Times", "01:02.8", "00:54.9"),
        "," * (width - 1),
        line(*channels),
        line(*(unit for unit, _ in channels.values())),
        "," * (width - 1),
    ]
    lines += [line(*(value(k) for _, value in channels.values())) for k in range(40)]
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize("quote", ["", '"'])
def test_an_export_with_its_imu(quote, tmp_path):
    r = read_recording(write(tmp_path / "a.csv", GPS | IMU, quote))
    np.testing.assert_allclose(r.imu.index, 0.05 * np.arange(40))
    np.testing.assert_allclose(r.imu[["ax", "az"]], np.tile([0.980665, 9.80665], (40, 1)))
    np.testing.assert_allclose(r.imu["gz"], np.radians(np.arange(40)))
    np.testing.assert_allclose(r.gnss["v_e"], (36 + np.arange(40)) / 3.6)
    np.testing.assert_allclose(r.gnss[["sd_e", "sd_n"]], 0.1)
    assert any("interpolates" in note for note in r.notes)


def test_an_export_of_the_receiver_alone(tmp_path):
    with pytest.warns(RecordingWarning, match=r"InlineAcc, LateralAcc and VerticalAcc are not all in it"):
        r = read_recording(write(tmp_path / "a.csv", GPS | {"InlineAcc": IMU["InlineAcc"]}))
    assert r.imu is None and len(r.gnss) == 40


def test_an_export_without_a_channel_that_is_known(tmp_path):
    path = write(tmp_path / "a.csv", {"Water Temp": ("C", lambda k: 80.0)})
    with pytest.raises(RecordingError, match=r"a.csv: has no time or nothing beside it that is known; .* 'Water Temp'"):
        read_recording(path)
