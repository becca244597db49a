"""OXTS folders that the tests write themselves."""

import numpy as np
import pytest

from altijax.recordings import RecordingError, RecordingWarning, read_recording

N = 40


def write(folder, n=N, times=N):
    oxts = folder / "2011_09_26_drive_0001_sync" / "oxts"
    (oxts / "data").mkdir(parents=True)
    stamps = [f"2011-09-26 23:59:{58 + 0.1 * k:012.9f}" for k in range(20)]
    stamps += [f"2011-09-27 00:00:{0.1 * k:012.9f}" for k in range(20)]
    (oxts / "timestamps.txt").write_text("\n".join(stamps[:times]) + "\n")
    for k in range(n):
        place, pose = [49.015, 8.434, 116.4], [0.01, 0.02, 0.5]
        motion = [3.0, 4.0, 5.0, 0.0, 0.25]
        inertial = [0.1 * k, 0.2, 9.8, 9, 9, 9, 0.01, 0.02, 0.03, 9, 9, 9]
        rest = [0.05, 0.04, 4, 10, 5, 5, 6]
        (oxts / "data" / f"{k:010d}.txt").write_text(" ".join(map(str, place + pose + motion + inertial + rest)) + "\n")
    return oxts


@pytest.mark.parametrize("inside", [True, False])
def test_a_drive_over_midnight(tmp_path, inside):
    oxts = write(tmp_path)
    r = read_recording(oxts if inside else oxts.parent)
    assert (r.name, r.axes) == ("2011_09_26_drive_0001_sync", "FLU")
    np.testing.assert_allclose(r.imu.index, 0.1 * np.arange(N), atol=1e-9)
    np.testing.assert_allclose(r.imu.iloc[3], [0.3, 0.2, 9.8, 0.01, 0.02, 0.03])
    np.testing.assert_allclose(r.gnss.iloc[0], [4, 3, 0.25, 49.015, 8.434, 116.4, 0.04, 0.04, 0.04])
    pose = [0.01, -0.02, np.pi / 2 - 0.5, 4, 3, 0.25, 49.015, 8.434, 116.4]
    np.testing.assert_allclose(r.reference.iloc[0], pose)
    assert any("are the same solution" in note for note in r.notes)


def test_a_frame_without_a_file_keeps_its_time(tmp_path):
    oxts = write(tmp_path)
    (oxts / "data" / "0000000005.txt").unlink()
    with pytest.warns(RecordingWarning, match=r"timestamps.txt has 40 times for 39 files"):
        r = read_recording(oxts)
    np.testing.assert_allclose(r.imu.index[4:6], [0.4, 0.6])


def test_a_file_without_a_time_is_left_out(tmp_path):
    with pytest.warns(RecordingWarning, match=r"timestamps.txt has 30 times for 40 files"):
        assert len(read_recording(write(tmp_path, times=30)).imu) == 30


@pytest.mark.parametrize("content", ["1 2 3", "1 2 x", ""])
def test_a_damaged_file_is_named(tmp_path, content):
    oxts = write(tmp_path)
    (oxts / "data" / "0000000007.txt").write_text(content)
    with pytest.raises(RecordingError, match=r"0000000007.txt: .*copy it again"):
        read_recording(oxts)


def test_damaged_times(tmp_path):
    oxts = write(tmp_path)
    (oxts / "timestamps.txt").write_text("yesterday\n")
    with pytest.raises(RecordingError, match=r"timestamps.txt: "):
        read_recording(oxts)
