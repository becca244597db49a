"""Known recordings: found, downloaded from a server on this machine, or explained."""

import dataclasses
import functools
import gc
import gzip
import hashlib
import http.server
import os
import threading
from pathlib import Path

import pytest

from altijax import datasets
from altijax.datasets import DatasetNotFoundError, dataset_path, list_datasets, load_dataset
from altijax.recordings import read_recording

LOCAL = ["comma2k19-example", "rtk-drive", "umn-thor75", "dresden-motorbike"]
IMU = "t,ax,ay,az\n0,0,0,9.8\n0.1,0,0,9.8\n0.2,0,0,9.8\n"


@pytest.fixture
def nothing_here(tmp_path, monkeypatch):
    """No local folder, and an empty cache."""
    monkeypatch.delenv("ALTIJAX_DATA_DIR", raising=False)
    monkeypatch.setattr(datasets.pooch, "os_cache", lambda project: tmp_path / "cache" / project)
    return tmp_path


@pytest.fixture
def origin(nothing_here, monkeypatch):
    """A server on this machine with one recording, entered in the registry; and its folder."""
    folder = nothing_here / "origin"
    (folder / "a|b").mkdir(parents=True)
    (folder / "a|b" / "imu.csv").write_text(IMU)
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=folder)
    monkeypatch.setattr(http.server.SimpleHTTPRequestHandler, "log_message", lambda *args: None)
    monkeypatch.setenv("NO_PROXY", "*")
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        entry = datasets._Dataset(
            sensors="IMU",
            duration=0.2,
            licence="MIT",
            origin="here",
            url=f"http://127.0.0.1:{server.server_port}/a%7Cb/",
            files={"imu.csv": hashlib.sha256(IMU.encode()).hexdigest()},
        )
        monkeypatch.setitem(datasets._DATASETS, "small", entry)
        yield folder / "a|b"
        server.shutdown()
    # The client leaves sockets of refused answers to the garbage collector, which would warn in some later test.
    gc.collect()


def test_the_list_names_every_recording_and_where_it_is(nothing_here, monkeypatch):
    table = list_datasets()
    assert list(table.columns) == ["sensors", "duration", "licence", "origin", "found"]
    assert table.index.to_list() == ["hill-road", *LOCAL]
    assert table.loc["hill-road", "found"] == "shipped"
    assert table.loc[LOCAL, "found"].to_list() == ["download"] * 4
    (nothing_here / "data" / "rtk-drive").mkdir(parents=True)
    monkeypatch.setenv("ALTIJAX_DATA_DIR", str(nothing_here / "data"))
    assert list_datasets().loc["rtk-drive", "found"] == "local"
    assert dataset_path("rtk-drive") == nothing_here / "data" / "rtk-drive"


def test_every_checksum_is_one(nothing_here):
    for name in LOCAL:
        files = datasets._DATASETS[name].files
        assert files and all(len(sha256) == 64 and set(sha256) <= set("0123456789abcdef") for sha256 in files.values())


@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_download_is_kept_and_used_again(origin, nothing_here):
    assert list_datasets().loc["small", "found"] == "download"
    assert len(load_dataset("small").imu) == 3
    assert list_datasets().loc["small", "found"] == "cached"
    (origin / "imu.csv").unlink()
    assert dataset_path("small") == nothing_here / "cache" / "altijax" / "small"
    assert load_dataset("small").name == "small"


@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_download_with_another_checksum_is_refused(origin, nothing_here):
    (origin / "imu.csv").write_text(IMU + "0.3,0,0,9.8\n")
    with pytest.raises(DatasetNotFoundError, match=r"imu.csv could not be downloaded .* \(its checksum is wrong\)"):
        load_dataset("small")
    assert not (nothing_here / "cache" / "altijax" / "small" / "imu.csv").exists()


@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_failed_download_says_what_to_put_where(origin, nothing_here, monkeypatch):
    (origin / "imu.csv").unlink()
    with pytest.raises(FileNotFoundError) as error:
        load_dataset("small")
    sha256 = datasets._DATASETS["small"].files["imu.csv"]
    for part in ("HTTPError", "(MIT; from here)", "set ALTIJAX_DATA_DIR", f"imu.csv  sha256 {sha256}"):
        assert part in str(error.value)
    monkeypatch.setenv("ALTIJAX_DATA_DIR", str(nothing_here / "mine"))
    with pytest.raises(DatasetNotFoundError, match=r"put these files into .*mine.small:"):
        load_dataset("small")
    (nothing_here / "mine" / "small").mkdir(parents=True)
    (nothing_here / "mine" / "small" / "imu.csv").write_text(IMU)
    assert len(load_dataset("small").imu) == 3


@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_no_server_at_all(origin, monkeypatch):
    closed = datasets._Dataset(
        sensors="", duration=0, licence="MIT", origin="", url="http://127.0.0.1:1/", files={"imu.csv": "0" * 64}
    )
    monkeypatch.setitem(datasets._DATASETS, "small", closed)
    with pytest.raises(DatasetNotFoundError, match=r"imu.csv could not be downloaded from .* \(ConnectionError\)"):
        load_dataset("small")


@pytest.fixture
def conversion(origin, monkeypatch):
    """The small recording as if it were made of a file with semicolons; and the folder with that file."""
    original = IMU.replace(",", ";").encode()
    (origin / "imu.txt").write_bytes(original)
    entry = datasets._DATASETS["small"]
    converted = dataclasses.replace(entry, originals={"imu.txt": hashlib.sha256(original).hexdigest()})
    monkeypatch.setitem(datasets._DATASETS, "small", converted)
    convert = lambda folder: {"imu.csv": (folder / "imu.txt").read_text().replace(";", ",")}  # noqa: E731
    monkeypatch.setitem(datasets.CONVERSIONS, "small", convert)
    return origin


@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_what_the_origin_has_in_another_form_is_fetched_and_converted(conversion, nothing_here, capsys):
    datasets.main(["fetch", "small"])
    assert capsys.readouterr().out.split() == ["small:", str(nothing_here / "cache" / "altijax" / "small")]
    assert list_datasets().loc["small", "found"] == "cached"
    assert len(load_dataset("small").imu) == 3


def test_a_conversion_of_a_folder_of_ones_own(conversion, nothing_here, capsys):
    with pytest.raises(
        SystemExit, match=r"there is no imu.txt in .*call altijax.dataset_path\('small', originals=FOLD"
    ):
        datasets.main(["fetch", "small", "--originals", str(nothing_here)])
    (nothing_here / "imu.txt").write_bytes((conversion / "imu.txt").read_bytes().replace(b"\n", b"\r\n"))
    with pytest.raises(DatasetNotFoundError, match=r"imu.txt has the SHA-256 .* changed in copying \(line ends"):
        dataset_path("small", originals=nothing_here)
    path = dataset_path("small", originals=conversion)
    assert (path / "imu.csv").read_text() == IMU
    with pytest.raises(SystemExit, match="hill-road is not made from other files"):
        datasets.main(["fetch", "hill-road", "--originals", str(conversion)])
    datasets.main(["list"])
    assert "small" in capsys.readouterr().out


def test_a_conversion_with_other_digits_is_not_kept(conversion, nothing_here, monkeypatch):
    monkeypatch.setitem(datasets.CONVERSIONS, "small", lambda folder: {"imu.csv": IMU.replace("9.8", "9.80001")})
    with pytest.raises(DatasetNotFoundError, match=r"imu.csv of small, .* arithmetic differs in a last"):
        dataset_path("small", originals=conversion)
    assert list_datasets().loc["small", "found"] == "download"


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(ValueError, match="there is no dataset 'hill'; known are hill-road, comma2k19-example"):
        load_dataset("hill")


def test_the_shipped_recording():
    r = load_dataset("hill-road")
    assert r.name == "hill-road" and r.notes == ()
    assert r.imu.index[-1] - r.imu.index[0] == pytest.approx(list_datasets().loc["hill-road", "duration"], abs=0.05)


@pytest.mark.parametrize("name", LOCAL)
def test_the_local_copies_are_those_that_were_registered(name, data_dir, monkeypatch):
    monkeypatch.setenv("ALTIJAX_DATA_DIR", str(data_dir))
    for file, sha256 in datasets._DATASETS[name].files.items():
        stored = dataset_path(name) / file
        content = stored.read_bytes() if stored.is_file() else gzip.decompress(Path(f"{stored}.gz").read_bytes())
        assert hashlib.sha256(content).hexdigest() == sha256


@pytest.mark.skipif(
    "ALTIJAX_ORIGINALS_DIR" not in os.environ, reason="no folder with the files as their origins give them"
)
@pytest.mark.parametrize("name", datasets.CONVERSIONS)
def test_the_originals_give_the_registered_files(name, nothing_here):
    dataset_path(name, originals=os.environ["ALTIJAX_ORIGINALS_DIR"])
    assert list_datasets().loc[name, "found"] == "cached"


def test_the_downloaded_files_of_comma2k19_suffice(data_dir, tmp_path):
    for file in datasets._DATASETS["comma2k19-example"].files:
        target = tmp_path / "comma2k19-example" / file
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes((data_dir / "comma2k19-example" / file).read_bytes())
    r = read_recording(tmp_path / "comma2k19-example")
    assert r.notes == () and None not in (r.imu is None, r.wheel is None) and len(r.reference) == 1200
    durations = r.imu.index[-1], list_datasets().loc["comma2k19-example", "duration"]
    assert durations[0] == pytest.approx(durations[1], abs=0.05)
