"""Carries out the runs of an experiment that its folder does not hold yet."""

import json
import os
import shutil
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import psutil

from tessera_cli.errors import RunError
from tessera_cli.experiments.checkouts import Checkout, cache_folder
from tessera_cli.experiments.commands import CommandRunner
from tessera_cli.experiments.plan import ExperimentFolder, PlannedRun, Sequence
from tessera_cli.experiments.progress_view import Durations, ProgressView, time_left_s
from tessera_cli.files import python_command, replacing, write_text
from tessera_cli.simulator import simulator_hash

# From this share of all cores on, other programs disturb a run.
DISTURBING_PERCENT = 10.0
CIRCUMSTANCES = "circumstances.json"
EVENTS = "events.csv"
# Of a recorded run: enough for a map that has settled, and not too much for a disk.
RECORDED_FRAMES = 240
# The map of a run may have a hundred megabytes, and its hash is in the summary.
NOT_KEPT = ("map.tessera", "map.ply", "run.lcmlog", "run.lcmlog.checksums")


@dataclass(frozen=True)
class RunOptions:
    """What is the same in all runs."""

    extractors: int
    frames: tuple[int, int]  # last exclusive; -1: to the end
    port: int


class ExperimentRunner:
    """Runs of the checkouts, one after the other. The first of them is this one."""

    def __init__(
        self,
        folder: ExperimentFolder,
        commands: CommandRunner,
        sides: Mapping[str, Checkout],
        options: RunOptions,
        view: ProgressView,
    ) -> None:
        self._folder, self._commands, self._sides = folder, commands, sides
        self._options, self._view = options, view
        self._here = next(iter(sides.values()))

    def render(self, sequence: Sequence) -> str:
        """The source to run: of a simulated world, the log that it is rendered into, once for all experiments."""
        kind, _, world = sequence.source.partition(":")
        if kind != "sim":
            return sequence.source
        last = self._options.frames[1]
        frames = f"-{last}" if last >= 0 else ""
        name = f"{world.replace('/', '_')}-{sequence.sensor}{frames}-{simulator_hash(world)}.lcmlog"
        log = cache_folder() / "rendered" / name
        if not log.is_file():
            self._view.say(f"rendering {sequence.source} into {log} (once)")
            log.parent.mkdir(parents=True, exist_ok=True)
            self._view.begin(f"rendering {sequence.name}")
            with replacing(log) as written:  # an interrupted recording would keep what it has
                words = ["record", sequence.source, str(written), "--sensor", sequence.sensor]
                words += ["--frames", f"0:{_last(last)}"]
                self._execute(self._here, f"render_{sequence.key}", words)
        return f"log:{log}"

    def measure_all(self, runs: list[PlannedRun], sources: Mapping[str, str]) -> None:
        """`sources`: by key of the sequence. Runs that the folder holds are not repeated.

        Raises RunError if one fails.
        """
        durations: Durations = {}
        for run in runs:
            if self._folder.summary(run):
                self._remember(run, durations)
        remaining = [run for run in runs if not self._folder.summary(run)]
        if len(remaining) < len(runs):
            self._view.say(f"{len(runs) - len(remaining)} of {len(runs)} runs are there already")
        while remaining:
            run = remaining[0]
            task = f"{run.sequence.title}, {run.side} {run.repetition}"
            self._view.begin(task, len(runs) - len(remaining), len(runs), time_left_s(remaining, durations))
            speed = self._measure(run, sources[run.sequence.key])
            self._remember(run, durations)
            remaining.pop(0)
            left = time_left_s(remaining, durations)
            self._view.say(
                f"run {len(runs) - len(remaining)} of {len(runs)}: {task}: {speed:.1f} frames/s"
                + (f"; about {left / 60:.0f} min left" if left else "")
            )

    def _measure(self, run: PlannedRun, source: str) -> float:
        path = self._folder.run_path(run)
        began, busy_s = time.monotonic(), _busy_s()
        cpu_s = self._run(self._sides[run.side], run.name, run.sequence, source, path, self._options.frames, [])
        duration_s, others_s = time.monotonic() - began, _busy_s() - busy_s - cpu_s
        summary = self._folder.summary(run)
        if summary is None:
            raise RunError(f"{run.name} did not come to its end: {self._folder.logs / f'{run.name}.log'} may say why.")
        for name in NOT_KEPT:
            (path / name).unlink(missing_ok=True)
        others_percent = 100 * max(0.0, others_s) / (duration_s * (os.cpu_count() or 1))
        circumstances = {"duration_s": round(duration_s, 1), "others_percent": round(others_percent, 1)}
        write_text(path / CIRCUMSTANCES, json.dumps(circumstances) + "\n")
        return summary["frames_per_s"]

    def _remember(self, run: PlannedRun, durations: Durations) -> None:
        duration_s = read_circumstances(self._folder.run_path(run)).get("duration_s")
        if duration_s is not None:
            durations.setdefault((run.sequence.key, run.side), []).append(duration_s)

    def record_events(self, sequence: Sequence, side: str, source: str) -> None:
        """When each process published what, in a run of its own, as EVENTS; its log, with all images, is removed.

        An older commit may not be able to: the experiment continues without.
        """
        path = self._folder.recording_path(sequence, side)
        if not (path / EVENTS).is_file():
            self._view.say(f"recording a run for the picture: {sequence.title}, {side}")
            self._view.begin("recording")
            first, last = self._options.frames
            last = min(last, first + RECORDED_FRAMES) if last >= 0 else first + RECORDED_FRAMES
            name = f"{sequence.key}_{side}"
            try:
                self._run(self._sides[side], f"record_{name}", sequence, source, path, (first, last), ["--record"])
                self._read_log(self._sides[side], f"events_{name}", path)
            except RunError as error:
                self._view.say(f"{sequence.title}, {side}, has no picture of a frame's way: {error}")
            for large in NOT_KEPT:
                (path / large).unlink(missing_ok=True)

    def _read_log(self, checkout: Checkout, name: str, path: Path) -> None:
        """By this checkout's code with the message types of the other's build."""
        here = self._here
        words = [*python_command("tessera_cli.experiments.events"), str(path / "run.lcmlog"), str(path / EVENTS)]
        environment = {**here.environment, "TESSERA_BUILD": str(checkout.build)}
        self._commands.run(name, words, here.folder, environment, self._view.look)

    def _run(
        self,
        checkout: Checkout,
        name: str,
        sequence: Sequence,
        source: str,
        path: Path,
        frames: tuple[int, int],
        more: list[str],
    ) -> float:
        """CPU seconds of the whole command. What an interrupted run left in `path` goes."""
        shutil.rmtree(path, ignore_errors=True)
        words = ["run", source, "--sensor", sequence.sensor, "--extractors", str(self._options.extractors)]
        words += ["--port", str(self._options.port), "--out", str(path), *more]
        if frames != (0, -1):
            words += ["--frames", f"{frames[0]}:{_last(frames[1])}"]
        return self._execute(checkout, name, words)

    def _execute(self, checkout: Checkout, name: str, words: list[str]) -> float:
        return self._commands.run(
            name, [*checkout.words, *words], checkout.folder, checkout.environment, self._view.look
        )


def _busy_s() -> float:
    """Of all cores since the start of the machine, with what a host took away from a virtual one."""
    times = psutil.cpu_times()
    return times.user + times.nice + times.system + times.irq + times.softirq + times.steal


def _last(frame: int) -> str:
    return str(frame) if frame >= 0 else ""


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
