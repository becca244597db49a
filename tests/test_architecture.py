"""Imports go one way, the core imports jax alone, and nothing that belongs to one machine is tracked."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docstrings import PACKAGE, imports_of, public_functions

ROOT = PACKAGE.parent

# Each level may import from the levels before it; modules of one level know nothing of each other.
LEVELS = [
    ["constants", "_shapes", "_safe", "_values", "_epoch_fit.trigonometry", "calibration.parameters"],
    ["rotations", "signals", "least_squares", "wahba"],
    ["calibration.identifiability", "calibration.serial_correlation", "calibration.standstill"],
    ["_epoch_fit.cost"],
    ["_epoch_fit.steps"],
    ["earth", "roads", "smoothing", "delays", "rotation_splines"],
    ["motion_estimate.preintegration", "motion_estimate.intervals", "inference.state_smoother"],
    ["motions", "sensors", "wheels", "doppler"],
    ["instruments", "strapdown"],
    ["calibration.allan", "calibration.static", "calibration.drive_model", "calibration.shared_parameters"],
    ["calibration.simulated_drives"],
    ["attitude", "calibration.experiment_design"],
    ["altitude", "speed"],
    ["speed_estimate.model"],
    ["speed_estimate.filter"],
    ["metrics"],
    ["padding", "series", "toml_lines", "programs", "speed_estimate.dead_reckoning"],
    ["inference.layout", "inference.levels"],
    ["stages", "formats.axes", "formats.stream_checks", "motion_estimate.start"],
    ["agreement.correlation", "agreement.units"],
    ["formats.stamps", "formats.packets", "formats.sentinels", "formats.stuck", "agreement.pairs"],
    ["agreement.axes", "agreement.velocities"],
    ["agreement.clocks"],
    ["agreement.report"],
    ["agreement.messages"],
    ["sweeps", "formats.tables", "formats.quantities", "formats.ubx_frames", "calibration.records"],
    ["formats.streams", "formats.text_tables", "formats.containers", "formats.ubx_solutions", "formats.ubx_ticks"],
    ["formats.mixed_tables"],
    ["formats.phones"],
    ["formats.sensor_logger", "formats.phyphox", "formats.androsensor", "formats.racechrono", "formats.aim"],
    ["formats.vbo", "formats.rtklib", "formats.nmea"],
    ["formats.dataflash", "formats.gopro", "formats.kitti", "formats.mdf", "formats.ros"],
    ["formats.tidy_folder", "formats.comma2k19", "formats.ulog", "formats.ublox", "calibration.priors"],
    ["formats.registry", "formats.tidy_writer"],
    ["recordings", "calibration.reference_fit"],
    ["conversions"],
    ["datasets", "drives", "tables", "simulation"],
    ["motion_estimate.readings", "elevation_estimate.model", "elevation_estimate.smoother", "calibration.drives"],
    ["vehicle.parts", "vehicle.mounting"],
    ["vehicle.inertial", "vehicle.measurements.course", "vehicle.measurements.standstill"],
    ["vehicle.measurements.doppler_velocity"],
    ["vehicle.measurements.gnss_position", "vehicle.measurements.known_height", "vehicle.measurements.wheel_speed"],
    ["vehicle.readings", "vehicle.sensors", "vehicle.between"],
    ["vehicle.transitions"],
    ["vehicle.smoother", "vehicle.start"],
    ["vehicle.beliefs", "vehicle.search", "vehicle.at_samples"],
    ["vehicle.estimates", "motion_estimate.epochs"],
    ["motion_estimate.epoch_attitudes"],
    ["elevation_estimate.posterior"],
    ["elevation_estimate.priors"],
    ["motion_estimate.batch", "motion_estimate.window"],
    ["elevation_estimate.estimates", "motion_estimate.estimates", "speed_estimate.steps"],
    ["streaming", "elevation_estimate.calibration", "motion_estimate.scores", "speed_estimate.estimates"],
    ["samples.make_hill_road", "samples.hilly_drives", "samples.foreign_drives"],
    ["speed_estimate.outages", "speed_estimate.calibration", "motion_estimate.calibration"],
    ["estimates", "gradients"],
    ["plots.style"],
    ["plots.elevation", "plots.speed", "plots.streams", "plots.map", "plots.sweeps"],
    ["plots.calibration", "plots.motion"],
]
LEVEL = {name: number for number, names in enumerate(LEVELS) for name in names}
CORE = {name for name in LEVEL if LEVEL[name] <= LEVEL["metrics"]}
MODULES = sorted(
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts)
    for folder in (path.parent for path in PACKAGE.rglob("__init__.py"))
    for path in folder.glob("*.py")
    if path.stem != "__init__"
)

FOLDERS = {f"altijax.{module.rpartition('.')[0]}" for module in MODULES if "." in module}


def file_of(module: str) -> Path:
    return PACKAGE.joinpath(*module.split(".")).with_suffix(".py")


def imported(path: Path) -> set[str]:
    """Dotted names a file imports; ``from altijax.folder import x`` counts as altijax.folder.x."""
    names = set()
    for node in imports_of(path):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif node.module == "altijax" or node.module in FOLDERS:
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif not isinstance(node, ast.Import):
            assert node.level == 0 and node.module, f"{path.name}: relative import"
            names.add(node.module)
    return names


def test_every_module_has_a_level_and_a_test() -> None:
    assert set(MODULES) == set(LEVEL)
    for module in MODULES:
        if not module.startswith("_") and module != "constants":
            *folder, name = module.split(".")
            assert (ROOT / "tests" / Path(*folder) / f"test_{name}.py").is_file(), module


@pytest.mark.parametrize("module", MODULES)
def test_imports_go_one_way(module: str) -> None:
    for name in imported(file_of(module)):
        package, _, rest = name.partition(".")
        if package == "altijax":
            assert rest in LEVEL and LEVEL[rest] < LEVEL[module], f"{module} imports {rest}"
        elif module in CORE and package not in sys.stdlib_module_names:
            assert package == "jax", f"{module} is core and imports {package}"


def test_core_modules_have_public_functions() -> None:
    for module in sorted(CORE - {"constants", "instruments", "_shapes", "_safe", "_values"}):
        assert len(public_functions(module)) >= 1, module


def tracked() -> list[Path]:
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True)
    return [ROOT / name for name in listed.stdout.split("\0") if name]


# Written in pieces, so that this file does not find itself.
FORBIDDEN = re.compile(
    "|".join(
        [
            "py" + r"pi\.org",
            "python" + r"hosted\.org",
            "registry" + r"\.npm",
            "deb" + r"ian\.org",
            "--(?:extra-)?" + "index-url",
            "--find" + "-links",
            "file:" + "//",
            r"(?<![A-Za-z0-9_.~/\-])/(?!usr/bin/env)(?:wo"
            + r"rk|tmp|ro"
            + r"ot|ho"
            + r"me|opt|usr|Users)/[A-Za-z0-9_.\-]+",
        ]
    )
)


def test_no_tracked_file_names_a_registry_or_a_path_of_one_machine() -> None:
    found = []
    for path in tracked():
        if path.is_file() and b"\0" not in path.read_bytes():
            for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
                if FORBIDDEN.search(line):
                    found.append(f"{path.relative_to(ROOT)}:{number}: {line[:100]}")
    assert not found, "\n".join(found)


def test_import_is_light() -> None:
    """Importing altijax loads neither pandas nor matplotlib nor Jupyter, and leaves jax's configuration alone."""
    code = (
        "import sys, jax; before = dict(jax.config.values); import altijax;"
        "assert dict(jax.config.values) == before;"
        "heavy = ('pandas', 'matplotlib', 'IPython', 'jupyterlab', 'pooch', 'scipy.signal');"
        "print([module for module in heavy if module in sys.modules])"
    )
    env = {name: value for name, value in os.environ.items() if name != "ALTIJAX_KEEP_PROGRAMS"}
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=env)
    assert result.stdout.strip() == "[]"
