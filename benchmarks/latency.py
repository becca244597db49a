"""What a person waits for: programs and CPU seconds of first calls, of each verb and method, beside an older commit.

    python -m benchmarks.latency [a part of a row's name ...]

Needs git, the commit it compares with, and comma2k19-example (ALTIJAX_DATA_DIR). Each row is measured in processes of
its own; seconds are user and system time of all threads, after the import, with the number of XLA programs in brackets:

    first     reading the minute, and the first call
    again     the same call once more
    other     the first 50 s of the recording, whose arrays have other lengths
    kept      like first, in a second process where `keep_programs` is on
    ratio     first, to that of the older commit, measured just before

Before any time the results of both commits are held against each other: they may differ by rounding, and in `batch`,
the speed filter and the calibrations by what their searches make of it.
"""

import json
import os
import pickle
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

BEFORE = "018b1e4"
ROOT = Path(__file__).resolve().parent.parent

# Limits on the ratio to `BEFORE`, and on the CPU seconds with kept programs.
LIMITS = {
    "elevation slope": (0.25, 1.5),
    "elevation shirai": (0.25, 1.5),
    "elevation fused": (0.35, 1.5),
    "elevation slope, known heights": (np.nan, 1.5),
    "speed filter 2+2": (0.6, 1.5),
    "speed filter 2+3": (0.6, 1.5),
    "speed filter 6": (0.6, 1.5),
    "speed conventional": (np.nan, 1.5),
    "speed roll": (np.nan, 1.5),
    "speed aided": (np.nan, 1.5),
    "motion epoch": (np.nan, 1.5),
    "motion window": (0.4, 1.5),
    "motion batch": (0.35, 3.0),
    "motion batch, no gyro": (np.nan, 3.0),
    "calibrate slope": (0.3, 1.5),
    "calibrate shirai": (np.nan, 1.5),
    "calibrate fused": (np.nan, 1.5),
    "calibrate conventional": (np.nan, 1.5),
    "calibrate roll": (np.nan, 1.5),
    "calibrate aided": (np.nan, 1.5),
    "calibrate filter": (np.nan, 1.5),
    "calibrate epoch": (np.nan, 1.5),
    "calibrate window": (np.nan, 1.5),
    "calibrate batch": (np.nan, 3.0),
    "calibrate drive": (0.35, 3.0),
}
# Results by least squares over few data, and by searches for noise levels, move with rounding by so many of their
# standard deviations at most; closed forms agree to so many of their units, and so do
# columns without a standard deviation behind a search.
MOVED, SAME, SEARCHED = 0.05, 1e-6, 1e-4
FITTED = {"slope": "accelerometer_bias_x", "shirai": "accelerometer_bias_x", "fused": "accelerometer_bias_x"}
FITTED |= {"filter": "accelerometer_bias_x", "conventional": "gyro_bias_y", "roll": "gyro_bias_y"}
FITTED |= {"aided": "gyro_bias_y", "epoch": "gnss_delay", "window": "gnss_delay", "batch": "gnss_delay"}

# What a fresh process does; it knows the public names of both commits only.
MEASURED = """
import dataclasses, json, pickle, sys, time, warnings
import jax
programs = []
jax.monitoring.register_event_duration_secs_listener(
    lambda event, seconds, **details: event.endswith("backend_compile_duration") and programs.append(details)
)
import altijax as aj
warnings.simplefilter("ignore")
name, result = sys.argv[1:]
verb, method, *options = name.replace(",", "").split(" ", 2)
begun = time.process_time()
recording = aj.load_dataset("comma2k19-example")
read = len(programs)
start, end = recording.imu.index[[0, -1]]

def call(recording):
    if verb == "elevation":
        heights = [(start, 10.0), (start + 45.0, 12.0)] if options else None
        return aj.estimate_elevation(recording, method=method, known_heights=heights)
    if verb == "speed":
        chosen = {"sensors": options[0]} if options else {}
        return aj.estimate_speed(recording, method=method, aid_until=start + 20, **chosen)
    if verb == "motion":
        return aj.estimate_motion(recording, method=method, use_gyro=not options)
    constants = FITTED.get(method) or None
    if constants is None:
        from altijax.estimates import ACCEPTED
        constants = ACCEPTED[method]
    return aj.calibrate(recording, constants, method=method, until=start + 40)

def measured(recording, begun):
    before = len(programs)
    found = call(recording)
    return found, (time.process_time() - begun, len(programs) - before)

def until(recording, last):
    cut = {s: getattr(recording, s) for s in ("imu", "wheel", "gnss", "reference")}
    cut = {s: frame if frame is None else frame[: start + last] for s, frame in cut.items()}
    return dataclasses.replace(recording, **cut)

found, first = measured(recording, begun)
rows = {"reading": read, "first": first}
if result != "only the first":
    rows["again"] = measured(recording, time.process_time())[1]
    rows["other"] = measured(until(recording, 50.0), time.process_time())[1]
    with open(result, "wb") as file:
        pickle.dump(found.table[["value", "std"]] if verb == "calibrate" else found, file)
print(json.dumps(rows))
""".replace("FITTED", repr(FITTED), 1)


def in_a_process(tree: Path, name: str, result: str, kept: Path | None = None) -> dict:
    """What a fresh process that imports altijax from a tree measured."""
    env = {key: value for key, value in os.environ.items() if key != "ALTIJAX_KEEP_PROGRAMS"}
    env |= {"PYTHONPATH": str(tree), "TQDM_DISABLE": "1"}
    env |= {} if kept is None else {"ALTIJAX_KEEP_PROGRAMS": str(kept)}
    run = subprocess.run(
        [sys.executable, "-c", MEASURED, name, result], env=env, cwd=tree, stdout=subprocess.PIPE, text=True, check=True
    )
    return json.loads(run.stdout.splitlines()[-1])


def assert_equal(name: str, ours: Path, theirs: Path) -> None:
    """Fail where the results of two commits differ by more than rounding makes of them."""
    new, old = (pickle.loads(path.read_bytes()) for path in (ours, theirs))
    if name.startswith("calibrate"):
        apart = ((new["value"] - old["value"]) / old["std"]).abs().max()
        assert apart < MOVED, f"{name}: constants moved by {apart:.3g} of their standard deviations"
        return
    for column in (column for column in old if old[column].dtype != bool):
        apart = (new[column] - old[column]).to_numpy()
        if column == "heading":
            apart = np.mod(apart + np.pi, 2 * np.pi) - np.pi
        bar = column if column.endswith("_std") else f"{column}_std"
        limit = SAME
        if name.startswith(("motion batch", "speed filter")):
            limit = MOVED * old[bar].mean() if bar in old else SEARCHED
        assert np.abs(apart).max() < limit, f"{name}: {column} moved by {np.abs(apart).max():.3g}"


def main(wanted: list[str]) -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as folder:
        base, kept = Path(folder) / "before", Path(folder) / "kept"
        subprocess.run(["git", "worktree", "add", "--quiet", "--detach", str(base), BEFORE], cwd=ROOT, check=True)
        try:
            rows = {}
            for name in LIMITS:
                if wanted and not any(part in name for part in wanted):
                    continue
                ours, theirs = Path(folder) / "ours", Path(folder) / "theirs"
                old = in_a_process(base, name, str(theirs))
                new = in_a_process(ROOT, name, str(ours))
                assert_equal(name, ours, theirs)
                in_a_process(ROOT, name, "only the first", kept)
                again = in_a_process(ROOT, name, "only the first", kept)
                ratio, limit = new["first"][0] / old["first"][0], LIMITS[name]
                rows[name] = {
                    "programs in reading": new["reading"],
                    **{key: f"{new[key][0]:.2f} ({new[key][1]})" for key in ("first", "again", "other")},
                    "kept": f"{again['first'][0]:.2f}" + (" MISSED" if again["first"][0] > limit[1] else ""),
                    "first before": f"{old['first'][0]:.2f} ({old['reading'] + old['first'][1]})",
                    "other before": f"{old['other'][0]:.2f} ({old['other'][1]})",
                    "ratio": f"{ratio:.2f}" + (f" of {limit[0]}" if np.isfinite(limit[0]) else ""),
                    "met": "" if np.isnan(limit[0]) else "met" if ratio <= limit[0] else "MISSED",
                }
                print(pd.DataFrame({name: rows[name]}).T.to_string(header=len(rows) == 1), flush=True)
            print(pd.DataFrame(rows).T.to_string())
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", str(base)], cwd=ROOT, check=True)


if __name__ == "__main__":
    main(sys.argv[1:])
