"""The folder of a run: where it is, what an earlier run left in it, and its content read again as a Result.

Positions of `Result.estimate` are in the estimate's own world; `Result.in_truth` transforms them into the truth's.
"""

import csv
import datetime
import json
import os
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from tessera_cli.console import say
from tessera_cli.constants import LOADED_MAP
from tessera_cli.errors import UserError
from tessera_cli.files import ROOT, absolute
from tessera_cli.maps.occupancy_file import Grid, read_grid
from tessera_cli.runs.sources import Source
from tessera_cli.runs.trajectories import Trajectory, TrajectoryError, absolute_error, read_trajectory
from tessera_cli.settings import Settings
from tessera_cli.text import visible, visible_values

TIME_OF_DAY = re.compile(r"\d\d:\d\d:\d\d")
SETTINGS_FILE = "settings.yaml"
# What a run leaves; files of an earlier run in the same folder must not be taken for its own.
RUN_FILES = (
    "summary.json",
    "run.json",
    "report.html",
    "trajectory.png",
    "trajectory.txt",
    "trajectory_live.txt",
    "trajectory_kitti.txt",
    "keyframes.txt",
    "map.ply",
    "map.tessera",
    "ground_truth.txt",
    "frames.csv",
    "loops.csv",
    "occupancy.bt",
    "occupancy.ot",
    "occupancy.pgm",
    "occupancy.yaml",
    "run.lcmlog",
    "run.lcmlog.checksums",
    SETTINGS_FILE,
)
LOOP_COLUMNS = ("keyframe_timestamp_s", "matched_timestamp_s", "inliers", "scale")
# How the sentences of source_watch.cc, live_source.cc and dispatcher_session.cc can be known.
SOURCE_EVENTS = (
    "no image for",
    "images come again",
    "the camera is connected",
    "connection to the camera",
    "the program that sends",
)
MAX_EVENTS = 50
OCCUPANCY_GRID = "occupancy.yaml"
# The one that is there and tells most.
OCCUPANCY_TREES = ("occupancy.ot", "occupancy.bt")
# Trajectory files keep microseconds.
SAME_TIME_S = 1e-4

Summary = dict[str, Any]  # of summary.json


def new_folder(name: str) -> Path:
    """The path of a folder under logs/ whose name begins with the present time."""
    return ROOT / "logs" / f"{datetime.datetime.now():%Y-%m-%d-%H%M%S}-{name}"


def choose_folder(out: str | None, source: Source) -> Path:
    """Of --out, else under logs/."""
    return absolute(out) if out else new_folder(source.name)


def require_no_run(folder: Path) -> None:
    """Raises UserError if the folder holds an earlier run, which would be overwritten. Settings alone are none."""
    if any((folder / name).exists() for name in RUN_FILES if name != SETTINGS_FILE):
        raise UserError(f"--out {folder}: it holds a run already; name another folder, or add --force to replace it.")


def remove_earlier_run(folder: Path) -> None:
    for name in RUN_FILES:
        (folder / name).unlink(missing_ok=True)
    for log in (folder / "stages").glob("*.log*"):
        log.unlink()


def keep_loaded_map(path: Path, folder: Path) -> Path:
    """The map that the run begins with, under a name of its own in the run's folder: a stage that is started again
    begins with the same one, also if the file (that of --map, each minute) has been replaced meanwhile."""
    kept = folder / LOADED_MAP
    if kept.exists() and kept.samefile(path):
        return kept
    kept.unlink(missing_ok=True)
    try:
        os.link(path, kept)
    except OSError:  # on another disk, or one that has no links
        shutil.copyfile(path, kept)
    return kept


def remove_journals(values: Settings) -> None:
    """What stages with these settings kept for their successors (modules/runtime/journal.h)."""
    if not values["stream"]["journal_dir"]:
        return
    folder = Path(values["stream"]["journal_dir"])
    for journal in folder.glob("*.journal*"):
        journal.unlink()
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()


def keeps_journal(folder: Path, process: str) -> bool:
    """Whether this process of the run that writes into the folder keeps a journal, by which a successor continues."""
    journals = read_settings(folder / SETTINGS_FILE).get("stream", {}).get("journal_dir", "")
    return bool(journals) and (Path(journals) / f"{process}.journal").is_file()


def leave_journals(values: Settings) -> None:
    """As far as a disk that has broken since lets them be removed. Nobody needs them when a run is over."""
    try:
        remove_journals(values)
    except OSError as error:
        say(f"the journals of this run could not be removed: {error.filename}: {error.strerror}")


@dataclass(frozen=True)
class Frames:
    """frames.csv, n rows in order of the frames' numbers. What is unknown is NaN."""

    times_s: np.ndarray  # in the source
    states: list[str]  # initializing, tracked, lost
    pose_time_ms: np.ndarray  # since the previous pose was published
    latency_ms: np.ndarray
    map_wait_ms: np.ndarray
    matches: np.ndarray
    inliers: np.ndarray
    landmarks: np.ndarray  # in the tracker's copy of the map
    is_keyframe: np.ndarray  # bool
    is_step_doubtful: np.ndarray  # bool: the images contradict the motion of a moment before
    scale_sigma: np.ndarray  # mono: what the images left open of ln(scale) in the last seconds
    numbers: np.ndarray


@dataclass(frozen=True)
class Loop:
    """A closed loop: times of the two keyframes, as in trajectory.txt."""

    keyframe_s: float
    matched_s: float
    inliers: int


@dataclass(frozen=True)
class Result:
    """One run, or one trajectory with its truth. What is missing is None or empty."""

    name: str
    estimate: Trajectory | None
    error: TrajectoryError | None = None
    error_note: str = ""  # why there is no error
    truth: Trajectory | None = None
    live: Trajectory | None = None  # as it was published during the run
    summary: Summary = field(default_factory=dict)
    frames: Frames | None = None
    loops: list[Loop] = field(default_factory=list)
    settings: Settings = field(default_factory=dict)
    log_warnings: list[str] = field(default_factory=list)
    grid: Grid | None = None  # of the occupancy stage, in the estimate's world
    voxel_tree: Path | None = None  # its file of voxels

    @property
    def unit(self) -> str:
        return "map units" if self.error is None and self.summary.get("sensor", "mono") == "mono" else "m"

    def in_truth(self, positions: np.ndarray) -> np.ndarray:
        """N x 3 of the estimate's world, aligned to the truth; unchanged without a truth."""
        return self.error.align(positions) if self.error else positions

    def path(self) -> np.ndarray:
        """N x 3, the estimated positions aligned to the truth. The result must have an estimate."""
        assert self.estimate is not None
        return self.in_truth(self.estimate.positions)

    def reference_path(self) -> np.ndarray:
        """N x 3, the true positions where there is an error, else the estimated ones."""
        return self.truth.positions if self.error and self.truth else self.path()

    def loop_lines(self) -> list[np.ndarray]:
        """For each loop, 2 x 3: the aligned positions of its two keyframes; NaN where there is no such keyframe."""
        if self.estimate is None:
            return []
        ends = [positions_at(self.estimate, [loop.keyframe_s, loop.matched_s]) for loop in self.loops]
        return [self.in_truth(positions) for positions in ends]


def read_run(folder: Path, truth_path: Path | None = None, alignment: str | None = None) -> Result:
    """`alignment`: sim3 or se3, by default according to the sensor. Raises UserError if it is no run's folder."""
    if not any((folder / name).is_file() for name in ("summary.json", "trajectory.txt", "trajectory_kitti.txt")):
        raise UserError(f"{folder} is no run's folder: it holds no trajectory.txt.")
    summary = _read_summary(folder / "summary.json")
    truth = _read_if_there(truth_path or folder / "ground_truth.txt")
    estimate = _read_if_there(folder / "trajectory.txt")
    if truth_path and truth is None:
        raise UserError(f"{truth_path}: holds no pose.")
    matching = estimate if truth is None or truth.has_times else _read_if_there(folder / "trajectory_kitti.txt")
    error, note = measure_error(matching, truth, alignment or default_alignment(summary))
    return Result(
        name=folder.absolute().name,
        estimate=estimate,
        error=error,
        error_note=note,
        truth=truth,
        live=_read_if_there(folder / "trajectory_live.txt"),
        summary=summary,
        frames=read_frames(folder / "frames.csv"),
        loops=read_loops(folder / "loops.csv"),
        settings=read_settings(folder / "settings.yaml"),
        log_warnings=read_log_warnings(folder / "stages"),
        grid=read_grid(folder / OCCUPANCY_GRID) if (folder / OCCUPANCY_GRID).is_file() else None,
        voxel_tree=next((folder / name for name in OCCUPANCY_TREES if (folder / name).is_file()), None),
    )


def read_pair(estimate_path: Path, truth_path: Path, alignment: str | None = None) -> Result:
    """Any two trajectory files. Raises UserError if they don't belong together."""
    estimate, truth = read_trajectory(estimate_path), read_trajectory(truth_path)
    error = absolute_error(estimate, truth, with_scale=(alignment or "sim3") == "sim3")
    return Result(name=estimate_path.stem, estimate=estimate, error=error, truth=truth)


def default_alignment(summary: Summary) -> str:
    """Mono doesn't know its scale; stereo and RGB-D must."""
    return "sim3" if summary.get("sensor", "mono") == "mono" else "se3"


def measure_error(
    estimate: Trajectory | None, truth: Trajectory | None, alignment: str
) -> tuple[TrajectoryError | None, str]:
    """The error, or None and the reason in words."""
    if truth is None:
        return None, "the source has no ground truth"
    if estimate is None:
        return None, "no frame was tracked"
    try:
        return absolute_error(estimate, truth, with_scale=alignment == "sim3"), ""
    except UserError as problem:
        return None, str(problem)


def _read_if_there(path: Path) -> Trajectory | None:
    """None also if the file has no rows."""
    if not path.is_file():
        return None
    has_rows = any(line.strip() and not line.startswith("#") for line in path.read_text().splitlines())
    return read_trajectory(path) if has_rows else None


def _read_summary(path: Path) -> Summary:
    if not path.is_file():
        return {}
    try:
        return visible_values(json.loads(path.read_text()))
    except ValueError as error:
        raise UserError(f"{path}: is no JSON ({error}).") from error


def read_settings(path: Path) -> Settings:
    """None if there is no such file, or if it is another user's, since only its owner can read it."""
    if not os.access(path, os.R_OK):
        return {}
    return visible_values(yaml.safe_load(path.read_text()) or {})


def _read_rows(path: Path) -> list[dict[str, str]]:
    if not path.is_file():
        return []
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def read_frames(path: Path) -> Frames | None:
    """None if there are no frames."""
    rows = _read_rows(path)
    if not rows:
        return None

    def column(name: str) -> np.ndarray:
        return np.array([float(row[name]) if row.get(name) else np.nan for row in rows])

    try:
        return Frames(
            times_s=1e-6 * column("utime_us"),
            states=[row["state"] for row in rows],
            pose_time_ms=column("pose_time_ms"),
            latency_ms=column("latency_ms"),
            map_wait_ms=column("map_wait_ms"),
            matches=column("matches"),
            inliers=column("inliers"),
            landmarks=column("landmarks"),
            is_keyframe=column("is_keyframe") > 0,
            is_step_doubtful=column("is_step_doubtful") > 0,
            scale_sigma=column("scale_sigma"),
            numbers=column("frame").astype(int),
        )
    except (KeyError, ValueError) as error:
        raise UserError(f"{path}: is no table of frames ({error}).") from error


def read_loops(path: Path) -> list[Loop]:
    """Columns LOOP_COLUMNS; none if there is no file."""
    keyframe, matched, inliers, _ = LOOP_COLUMNS
    try:
        return [Loop(float(row[keyframe]), float(row[matched]), int(float(row[inliers]))) for row in _read_rows(path)]
    except (KeyError, TypeError, ValueError) as error:
        columns = ", ".join(LOOP_COLUMNS)
        raise UserError(f"{path}: is no table of loops; its columns must be {columns}.") from error


def read_source_events(folder: Path) -> list[str]:
    """What happened to a live source, in order, each with its time of day: silence, broken and new connections."""
    lines: list[tuple[int, str]] = []
    for name in ("camera", "dispatcher"):
        path = folder / f"{name}.log"
        if path.is_file():
            dated = _with_days(path.read_text(errors="replace").splitlines())
            lines += [(day, line) for day, line in dated if _is_source_event(line)]
    events = [f"{line.split()[0]}: {line.split(': ', 1)[1]}." for _, line in sorted(lines)]
    more = len(events) - MAX_EVENTS
    return events if more <= 0 else [*events[:MAX_EVENTS], f"{more} more events of the source are in {folder}."]


def _with_days(lines: list[str]) -> Iterator[tuple[int, str]]:
    """Each with how often midnight has passed since the first: lines of logs begin with the time of day."""
    day, latest = 0, ""
    for line in lines:
        if TIME_OF_DAY.match(line):
            day += 1 if line[:8] < latest else 0
            latest = line[:8]
        yield day, line


def _is_source_event(line: str) -> bool:
    is_problem = " warning: " in line or " error: " in line
    return is_problem and any(words in line for words in SOURCE_EVENTS)


def read_log_warnings(folder: Path) -> list[str]:
    """For each process that logged warnings or errors: how many, and the first one."""
    found = []
    for path in sorted(folder.glob("*.log")):
        lines = path.read_text(errors="replace").split("\n")
        warnings = [line for line in lines if " warning: " in line or " error: " in line]
        warnings = [line for line in warnings if not _is_source_event(line)]
        if warnings:
            first = warnings[0].split(": ", 1)[1]
            count = f"{len(warnings)} {'problem' if len(warnings) == 1 else 'problems'}"
            found.append(f"{path.stem} reported {count}, the first: {visible(first)}")
    return found


def positions_at(trajectory: Trajectory, times_s: list[float]) -> np.ndarray:
    """N x 3, of the poses at these times; NaN where there is none."""
    positions = np.full((len(times_s), 3), np.nan)
    for i, time_s in enumerate(times_s):
        nearest = int(np.argmin(np.abs(trajectory.timestamps_s - time_s)))
        if abs(trajectory.timestamps_s[nearest] - time_s) <= SAME_TIME_S:
            positions[i] = trajectory.positions[nearest]
    return positions
