"""Known recordings: where they come from, and how to get at them.

`ALTIJAX_DATA_DIR` names a folder with one subfolder a recording, which is looked at first and taken as it is. What is
not there is downloaded into the user's cache, or made there from what its origin serves, checksums verified.
``python -m altijax.datasets fetch NAME`` does so beforehand.
"""

import argparse
import hashlib
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

import pandas as pd
import pooch

from altijax.conversions import CONVERSIONS
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
    url: str = ""
    """Address of the folder at the origin."""
    originals: dict[str, str] = field(default_factory=dict)
    """SHA-256 of each file at the origin from which `CONVERSIONS` makes the recording; empty where it is read as is."""
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
        url=(
            "https://raw.githubusercontent.com/rtklibexplorer/GNSS_IMU/8235ee6c5f349db529bf43ad556a3769b346b5a1/"
            "data/drive_0708/"
        ),
        originals={
            "gnss_1934_sf.pos": "618fba5c7193e8eb448faf95c79c0d198233d5f4e5ad8ffec652893911ff7133",
            "imu_1934.csv": "f1126bf3b36efc4bef2dd2c7d93bb2a0e1b4ce714005cbea00a9218ad0b3b7a9",
            "imu_1934.csv.tag": "d30d13d5641df367559472b91b48325601a87c986bf2bb6af368684a36b5ec96",
        },
        files={
            "imu.csv": "dd06e388c8bfc9bcd3de35bb7ebd78b91cbcbcd48d089b6d870ce143a0ffc953",
            "gnss.csv": "831ddec44dd9c150b6e20a6288e2310ec6a8c9e92a6c8e2a6227ef2d7b6e9e71",
            "reference.csv": "ea3b1b05601eb61bd6e3f739b5d7bb30247eed4e7c0938b1beec461fc32aafec",
            "recording.toml": "c116c6b4ea1cdcce7ef7d46de06efd674d5af4d8cf47287cc0683fd82f2b1a46",
        },
    ),
    "umn-thor75": _Dataset(
        sensors="IMU 50 Hz, GNSS velocity 1 Hz, reference 50 Hz (on-board filter of the same sensors)",
        duration=194.0,
        licence="MIT",
        origin="github NorthStarUAS/insgnss_tools 0b5f6b16f0, thor flight 75, first part, converted",
        url=(
            "https://raw.githubusercontent.com/NorthStarUAS/insgnss_tools/0b5f6b16f00997baa5e02f85d1959355aa2a4c82/"
            "flight_data/"
        ),
        originals={
            "thor_flight75_WaypointTracker_150squareWaypointNew_2012_10_10.mat": (
                "d87340d8a5ab2bbc0121e73521bb68bfc9042786c78329d965c5aca6d0431675"
            ),
        },
        files={
            "imu.csv": "43da92e10510bc916bf21d3578f689a5e655786124d43397d3c9159ffb73bbca",
            "gnss.csv": "9634ebf0ccec2ca17246527bc7a08f0824e7b43b8b3c578f524cacfff355c545",
            "reference.csv": "b9f2a2d081fa190190a22bd0ddbc6ea2b1a450b2f8e9d8cffea199d59bb04e6a",
            "recording.toml": "112c7dd57fd62dc8efe4f2c6ca17a9bd7668ed5cd7b5793bef2715ac2bf06831",
        },
    ),
    "dresden-motorbike": _Dataset(
        sensors="IMU 51 Hz, GNSS speed and course 1 Hz",
        duration=105.5,
        licence="CC-BY-SA-2.0",
        origin="github balzer82/Kalman 61b1ec4e, converted",
        url="https://raw.githubusercontent.com/balzer82/Kalman/61b1ec4e4a5aaf18e1caa8f3bcd99113daa3d2ca/",
        originals={
            "2016-08-09-Motorbike.csv": "ac5761a488234868dad79eea9279945c9aebf332dc2fe3d3b4c4fbb03ddd275b",
        },
        files={
            "imu.csv": "62cc386f1deb7194b7ca4a4bc46ef558fb5248f25225573dc5548e9f5b95264b",
            "gnss.csv": "20b7642902e5eaccbab85cb4fef7b2aad74e5093b9930ce7a19941d3293ba264",
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
        with the package, "local" in ALTIJAX_DATA_DIR, "cached" by an earlier download, else "download":
        `load_dataset` would fetch it, and convert it where need be.
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


def dataset_path(name: str, *, originals: str | Path | None = None) -> Path:
    """Folder of a known recording, downloaded and converted first if need be.

    Parameters
    ----------
    name : str
        One of `list_datasets`.
    originals : path, optional
        Folder with the files as their origin gives them, for a recording that is made from them: it is then made anew
        from these, without a download.

    Returns
    -------
    path : Path
        In ALTIJAX_DATA_DIR, the package or the user's cache; always in the cache with `originals`.

    Raises
    ------
    ValueError
        If the name is not known, or `originals` is given for a recording that is not made from any.
    DatasetNotFoundError
        If the recording is neither here nor to be had; it says what to put where.
    """
    if name not in _DATASETS:
        raise ValueError(f"there is no dataset {name!r}; known are {', '.join(_DATASETS)}")
    dataset = _DATASETS[name]
    if originals is not None:
        if not dataset.originals:
            raise ValueError(f"{name} is not made from other files; call dataset_path({name!r}) without originals")
        _require(Path(originals), name, dataset)
        return _made(name, dataset, Path(originals))
    found, path = _place(name, dataset)
    if found == "not here":
        raise DatasetNotFoundError(f"{name} comes with the package and is missing from it: install altijax again")
    if found != "download":
        return path
    if not dataset.originals:
        return _downloaded(name, dataset, dataset.files, path)
    return _made(name, dataset, _downloaded(name, dataset, dataset.originals, _cache() / "originals" / name))


def _cache() -> Path:
    return Path(pooch.os_cache("altijax"))


def _place(name: str, dataset: _Dataset) -> tuple[str, Path]:
    """Where a recording was found, and its folder there (or where it would be downloaded to)."""
    if dataset.shipped:
        path = Path(str(resources.files("altijax") / "samples" / name))
        return ("shipped" if path.is_dir() else "not here"), path
    folder = os.environ.get("ALTIJAX_DATA_DIR")
    if folder and (Path(folder) / name).is_dir():
        return "local", Path(folder) / name
    cache = _cache() / name
    # A download that broke off leaves some files missing, and is taken up again.
    return ("cached" if all((cache / file).is_file() for file in dataset.files) else "download"), cache


def _downloaded(name: str, dataset: _Dataset, files: Mapping[str, str], path: Path) -> Path:
    """The folder into which the files were downloaded, those that were there already left as they are."""
    registry = {file: f"sha256:{sha256}" for file, sha256 in files.items()}
    store = pooch.create(path=path, base_url=dataset.url, registry=registry)
    for file in files:
        try:
            store.fetch(file, downloader=pooch.HTTPDownloader(timeout=10))
        except (OSError, ValueError) as error:  # pooch raises ValueError for a wrong checksum
            reason = "its checksum is wrong" if isinstance(error, ValueError) else type(error).__name__
            raise DatasetNotFoundError(
                f"{file} could not be downloaded from {dataset.url} ({reason}). {_advice(name, dataset)}"
            ) from error
    return path


def _require(folder: Path, name: str, dataset: _Dataset) -> None:
    for file, sha256 in dataset.originals.items():
        if not (folder / file).is_file():
            raise DatasetNotFoundError(f"there is no {file} in {folder}. {_advice(name, dataset)}")
        seen = hashlib.sha256((folder / file).read_bytes()).hexdigest()
        if seen != sha256:
            raise DatasetNotFoundError(
                f"{folder / file} has the SHA-256 {seen}: it is another version, or was changed in copying (line ends?)"
                f". {_advice(name, dataset)}"
            )


def _made(name: str, dataset: _Dataset, originals: Path) -> Path:
    """The folder in the cache into which the recording was converted."""
    path = _cache() / name
    path.mkdir(parents=True, exist_ok=True)
    for file, text in CONVERSIONS[name](originals).items():
        content = text.encode()
        if hashlib.sha256(content).hexdigest() != dataset.files[file]:
            raise DatasetNotFoundError(
                f"{file} of {name}, made from {originals}, is not what it was elsewhere: this machine's arithmetic "
                f"differs in a last digit. Copy {path} from another one"
            )
        (path / file).write_bytes(content)
    return path


def _advice(name: str, dataset: _Dataset) -> str:
    files = "\n".join(f"  {file}  sha256 {sha256}" for file, sha256 in (dataset.originals or dataset.files).items())
    if dataset.originals:
        return (
            f"To use {name} ({dataset.licence}; from {dataset.origin}), put these files from {dataset.url} into a "
            f"folder and call altijax.dataset_path({name!r}, originals=FOLDER):\n{files}"
        )
    folder = os.environ.get("ALTIJAX_DATA_DIR")
    where = (
        str(Path(folder) / name) if folder else f"a folder {name} and set ALTIJAX_DATA_DIR to the folder that holds it"
    )
    return f"To use {name} ({dataset.licence}; from {dataset.origin}), put these files into {where}:\n{files}"


def main(arguments: Sequence[str]) -> None:
    """The command line of ``python -m altijax.datasets``."""
    parser = argparse.ArgumentParser(prog="python -m altijax.datasets", description="Known recordings.")
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help="show the known recordings and where they are")
    fetch = commands.add_parser(
        "fetch", help="download recordings, and convert them where their origin has another form"
    )
    fetch.add_argument("names", nargs="+", metavar="name", help=f"one of {', '.join(_DATASETS)}")
    fetch.add_argument("--originals", metavar="FOLDER", help="take the files as the origin gives them from this folder")
    given = parser.parse_args(arguments)
    if given.command == "list":
        print(list_datasets()[["found", "licence", "sensors"]].to_string())
        return
    for name in given.names:
        try:
            print(f"{name}: {dataset_path(name, originals=given.originals)}")
        except (DatasetNotFoundError, ValueError) as error:
            sys.exit(str(error))


if __name__ == "__main__":
    main(sys.argv[1:])
