"""Known recordings: where they come from, and how to get at them.

`ALTIJAX_DATA_DIR` names a folder with one subfolder a recording, which is looked at first and taken as it is. What is
not there is downloaded into the user's cache, checksums verified, where its origin serves it as it is read.
"""

import os
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

import pandas as pd
import pooch

from altijax.recordings import Recording, read_recording


class DatasetNotFoundError(FileNotFoundError):
    """A known recording is not on this machine; the message says what to put where."""


@dataclass(frozen=True, kw_only=True)
class _Dataset:
    sensors: str
    duration: float
    licence: str
    origin: str
    files: dict[str, str] = field(default_factory=dict)
    """SHA-256 of each file that is read, by its path in the recording's folder."""
    url: str | None = None
    """Address of that folder at the origin; None where the folder is a conversion of what the origin holds."""
    shipped: bool = False


_DATASETS = {
    "hill-road": _Dataset(
        sensors="IMU 50 Hz, pulses of two wheels, GNSS 5 Hz, reference 10 Hz (exact)",
        duration=90.0,
        licence="MIT",
        origin="made by this package's own models",
        shipped=True,
    ),
    "comma2k19-example": _Dataset(
        sensors="IMU 104 Hz, four wheel speeds 83 Hz, GNSS 10 Hz, reference 20 Hz",
        duration=60.0,
        licence="MIT",
        origin="github commaai/comma2k19 4c7f1a6, Example_1, segment b0c9d2329ad1606b|2018-08-02--08-34-47/40",
        url=(
            "https://raw.githubusercontent.com/commaai/comma2k19/4c7f1a6e1957745beadc1def0e7225f559b09a2a/"
            "Example_1/b0c9d2329ad1606b%7C2018-08-02--08-34-47/40/"
        ),
        files={
            "global_pose/frame_orientations": "0eee212a8a1e6cc79978d84217aba068bd3ab9f441a6c1eebb51052ba698d1bb",
            "global_pose/frame_positions": "85864c9632030f5b6f0a6a8a78f2c9079e7555725d38a28ae029ed5dd4fc9057",
            "global_pose/frame_times": "2bec8428f9302b30a7edef3b86de0bc797c77e6964f404b3d982af1ce4dfcb5d",
            "global_pose/frame_velocities": "2e2a3b5d222153b440db70b34ea91e4f0eda661d4b139f16d7b057754cd978c2",
            "processed_log/CAN/wheel_speed/t": "53d2a88becfc45f9dcb804f2f78436f2bb6246d80386ff18ded10af679d5d6f3",
            "processed_log/CAN/wheel_speed/value": "021dd8d0ac5029b34d3d2ddfc53c2654944baf57da4cb45d7ac4b0f995c69d2f",
            "processed_log/GNSS/live_gnss_ublox/t": "238794a8b336a9dc69e6787116d6e8fe4ce9013e4f454ca2bcde010b43011e95",
            "processed_log/GNSS/live_gnss_ublox/value": (
                "1136d8819a640d482c06ed6460efdb84a625ddf765ed581b1cf28f030dabfff3"
            ),
            "processed_log/IMU/accelerometer/t": "9df28fe965d5936bb91a020b688e35304ee4b823e388cb814d077b1f934a8558",
            "processed_log/IMU/accelerometer/value": "313949234c212c4f02b0a7c5f1c14173ac2b4dac50297782f50dc4e43fc9579b",
            "processed_log/IMU/gyro/t": "9df28fe965d5936bb91a020b688e35304ee4b823e388cb814d077b1f934a8558",
            "processed_log/IMU/gyro/value": "7af1d2f8b2ec8b78a0af59dde3a3e40bf8a8d425fb0c96a7fc71cadc0830b50c",
        },
    ),
    "rtk-drive": _Dataset(
        sensors="IMU 100 Hz, RTK GNSS with Doppler velocity 4 Hz, reference 4 Hz (RTK height)",
        duration=326.6,
        licence="BSD-3-Clause",
        origin="github rtklibexplorer/GNSS_IMU 8235ee6c5f, data/drive_0708, first part, converted",
        files={
            "gnss.csv.gz": "d1e6adc26a3f7ae9dc87348def75406b6f1d33d29da0df4a40bf45fa345470f4",
            "imu.csv.gz": "b14fbe4157314dc3ae785e05e0be9a1f210ecaf316b81b51ff24a72b60aede6d",
            "recording.toml": "c116c6b4ea1cdcce7ef7d46de06efd674d5af4d8cf47287cc0683fd82f2b1a46",
            "reference.csv.gz": "d8d93dd5ae35e9395b76426dc35459977550e9d61e951e5c440ea71da2150d8c",
        },
    ),
    "umn-thor75": _Dataset(
        sensors="IMU 50 Hz, GNSS velocity 1 Hz, reference 50 Hz (on-board filter of the same sensors)",
        duration=194.0,
        licence="MIT",
        origin="github NorthStarUAS/insgnss_tools 0b5f6b16f0, thor flight 75, first part, converted",
        files={
            "gnss.csv.gz": "52c424230eb733d450c8d2f9dc39b17237e5635dfd2e805d079f30caa9dfa8e8",
            "imu.csv.gz": "7d3eedb3ae4df796a26b5a4c417b910270de0c979a45113a4619aaee72a7567a",
            "recording.toml": "112c7dd57fd62dc8efe4f2c6ca17a9bd7668ed5cd7b5793bef2715ac2bf06831",
            "reference.csv.gz": "1d462b054b9099e708453e8ba58d7cf3d1cf78bdba23edd22f25eb1850af575e",
        },
    ),
    "dresden-motorbike": _Dataset(
        sensors="IMU 51 Hz, GNSS speed and course 1 Hz",
        duration=105.5,
        licence="CC-BY-SA-2.0",
        origin="github balzer82/Kalman 61b1ec4e, converted",
        files={
            "gnss.csv.gz": "240b63a8d9a3b6626bf093175a9e73f26254667a6a90043c263a5336670d8443",
            "imu.csv.gz": "319cb9a33ec5dc5540a7921f88e8bf64106a6faf4a26de34855413a69bfebaf1",
            "recording.toml": "af5a308bd1cdfa09c627b635ecff4643f3d2750d8ff2faf4e4472816b1a4b5f2",
        },
    ),
}


def list_datasets() -> pd.DataFrame:
    """The known recordings.

    Returns
    -------
    table : DataFrame
        One row a recording, indexed by name: sensors, duration in s, licence, origin, and where it was found: "shipped"
        with the package, "local" in ALTIJAX_DATA_DIR, "cached" by an earlier download, else "download" if
        `load_dataset` would fetch it, or "not here".
    """
    rows = {
        name: {
            "sensors": dataset.sensors,
            "duration": dataset.duration,
            "licence": dataset.licence,
            "origin": dataset.origin,
            "found": _place(name, dataset)[0],
        }
        for name, dataset in _DATASETS.items()
    }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("name")


def load_dataset(name: str) -> Recording:
    """Read a known recording, downloading it first if need be.

    Parameters
    ----------
    name : str
        One of `list_datasets`.

    Returns
    -------
    recording : Recording
        As `read_recording` gives it.

    Raises
    ------
    ValueError
        If the name is not known.
    DatasetNotFoundError
        If the recording is neither here nor to be had; it says what to put where.
    """
    return read_recording(dataset_path(name))


def dataset_path(name: str) -> Path:
    """Folder of a known recording, downloaded first if need be.

    Parameters
    ----------
    name : str
        One of `list_datasets`.

    Returns
    -------
    path : Path
        In ALTIJAX_DATA_DIR, the package or the cache of downloads.

    Raises
    ------
    ValueError
        If the name is not known.
    DatasetNotFoundError
        If the recording is neither here nor to be had; it says what to put where.
    """
    if name not in _DATASETS:
        raise ValueError(f"there is no dataset {name!r}; known are {', '.join(_DATASETS)}")
    dataset = _DATASETS[name]
    found, path = _place(name, dataset)
    if found == "not here":
        raise DatasetNotFoundError(_advice(name, dataset))
    if found != "download":
        return path
    store = pooch.create(path=path, base_url=dataset.url, registry=_checksums(dataset))
    for file in dataset.files:
        try:
            store.fetch(file, downloader=pooch.HTTPDownloader(timeout=10))
        except (OSError, ValueError) as error:  # pooch raises ValueError for a wrong checksum
            reason = "its checksum is wrong" if isinstance(error, ValueError) else type(error).__name__
            raise DatasetNotFoundError(
                f"{file} could not be downloaded from {dataset.url} ({reason}). {_advice(name, dataset)}"
            ) from error
    return path


def _place(name: str, dataset: _Dataset) -> tuple[str, Path]:
    """Where a recording was found, and its folder there (or where it would be downloaded to)."""
    if dataset.shipped:
        path = Path(str(resources.files("altijax") / "samples" / name))
        return ("shipped" if path.is_dir() else "not here"), path
    folder = os.environ.get("ALTIJAX_DATA_DIR")
    if folder and (Path(folder) / name).is_dir():
        return "local", Path(folder) / name
    cache = Path(pooch.os_cache("altijax")) / name
    if dataset.url is None:
        return "not here", cache
    # A download that broke off leaves some files missing, and is taken up again.
    return ("cached" if all((cache / file).is_file() for file in dataset.files) else "download"), cache


def _checksums(dataset: _Dataset) -> dict[str, str]:
    return {file: f"sha256:{sha256}" for file, sha256 in dataset.files.items()}


def _advice(name: str, dataset: _Dataset) -> str:
    if dataset.shipped:
        return f"{name} comes with the package and is missing from it: install altijax again"
    folder = os.environ.get("ALTIJAX_DATA_DIR")
    where = (
        str(Path(folder) / name) if folder else f"a folder {name} and set ALTIJAX_DATA_DIR to the folder that holds it"
    )
    files = "\n".join(f"  {file}  sha256 {sha256}" for file, sha256 in dataset.files.items())
    return f"To use {name} ({dataset.licence}; from {dataset.origin}), put these files into {where}:\n{files}"
