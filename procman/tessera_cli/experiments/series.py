"""Carries out the runs of an experiment that its folder does not hold yet, and tells what disturbed them."""

import json
import os
import time
from collections.abc import Callable
from pathlib import Path

import psutil

from tessera_cli.errors import RunError
from tessera_cli.experiments.plan import ExperimentFolder, PlannedRun
from tessera_cli.experiments.progress_view import Durations, ProgressView, time_left_s
from tessera_cli.files import write_text

# From this share of all cores on, other programs disturb a run.
DISTURBING_PERCENT = 10.0
CIRCUMSTANCES = "circumstances.json"
# The map of a run may have a hundred megabytes, and its hash is in the summary.
NOT_KEPT = ("map.tessera", "map.ply", "run.lcmlog", "run.lcmlog.checksums")

# Carries out one run and returns the CPU seconds of all that it started.
CarryOut = Callable[[PlannedRun], float]


def measure_all(folder: ExperimentFolder, runs: list[PlannedRun], carry_out: CarryOut, view: ProgressView) -> None:
    """Runs that the folder holds are not repeated. Raises RunError if one fails."""
    durations: Durations = {}
    for run in runs:
        if folder.summary(run):
            _remember(folder, run, durations)
    remaining = [run for run in runs if not folder.summary(run)]
    if len(remaining) < len(runs):
        view.say(f"{len(runs) - len(remaining)} of {len(runs)} runs are there already")
    while remaining:
        run = remaining[0]
        task = f"{run.sequence.title}, {run.side} {run.repetition}"
        view.begin(task, len(runs) - len(remaining), len(runs), time_left_s(remaining, durations))
        speed = _measure(folder, run, carry_out)
        _remember(folder, run, durations)
        remaining.pop(0)
        left = time_left_s(remaining, durations)
        view.say(
            f"run {len(runs) - len(remaining)} of {len(runs)}: {task}: {speed:.1f} frames/s"
            + (f"; about {left / 60:.0f} min left" if left else "")
        )


def _measure(folder: ExperimentFolder, run: PlannedRun, carry_out: CarryOut) -> float:
    path = folder.run_path(run)
    began, busy_s = time.monotonic(), _busy_s()
    cpu_s = carry_out(run)
    duration_s, others_s = time.monotonic() - began, _busy_s() - busy_s - cpu_s
    summary = folder.summary(run)
    if summary is None:
        raise RunError(f"{run.name} did not come to its end: {folder.logs / f'{run.name}.log'} may say why.")
    for name in NOT_KEPT:
        (path / name).unlink(missing_ok=True)
    others_percent = 100 * max(0.0, others_s) / (duration_s * (os.cpu_count() or 1))
    circumstances = {"duration_s": round(duration_s, 1), "others_percent": round(others_percent, 1)}
    write_text(path / CIRCUMSTANCES, json.dumps(circumstances) + "\n")
    return summary["frames_per_s"]


def _remember(folder: ExperimentFolder, run: PlannedRun, durations: Durations) -> None:
    duration_s = read_circumstances(folder.run_path(run)).get("duration_s")
    if duration_s is not None:
        durations.setdefault((run.sequence.key, run.side), []).append(duration_s)


def _busy_s() -> float:
    """Of all cores since the start of the machine, with what a host took away from a virtual one."""
    times = psutil.cpu_times()
    return times.user + times.nice + times.system + times.irq + times.softirq + times.steal


def read_circumstances(path: Path) -> dict[str, float]:
    """`duration_s` of the whole command, `others_percent`: what other programs used of all cores meanwhile."""
    try:
        return json.loads((path / CIRCUMSTANCES).read_text())
    except (OSError, ValueError):
        return {}


def disturbances(folder: ExperimentFolder, runs: list[PlannedRun]) -> list[str]:
    """Sentences about what makes the figures less trustworthy; empty if nothing."""
    found = []
    others = [read_circumstances(folder.run_path(run)).get("others_percent", 0.0) for run in runs]
    if disturbed := [percent for percent in others if percent >= DISTURBING_PERCENT]:
        found.append(
            f"During {len(disturbed)} of {len(runs)} runs, other programs used up to {max(disturbed):.0f} % of this "
            "machine: the figures are only indicative."
        )
    summaries = [(run, folder.summary(run) or {}) for run in runs]
    if repaired := [summary["messages_repaired"] for _, summary in summaries if summary.get("messages_repaired")]:
        found.append(
            f"In {len(repaired)} of {len(runs)} runs messages got lost and were sent again, up to {max(repaired)}; "
            "each costs 10 ms or more."
        )
    for key, what in (("frames_dropped", "dropped frames"), ("extractor_restarts", "restarted extractors")):
        found += [f"{run.name}: {summary[key]} {what}." for run, summary in summaries if summary.get(key)]
    return found
