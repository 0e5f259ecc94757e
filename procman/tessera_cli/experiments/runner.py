"""Runs `tessera run` of the checkouts that an experiment compares."""

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from tessera_cli.errors import RunError
from tessera_cli.experiments.checkouts import Checkout
from tessera_cli.experiments.commands import CommandRunner
from tessera_cli.experiments.plan import ExperimentFolder, PlannedRun, Sequence
from tessera_cli.experiments.progress_view import ProgressView
from tessera_cli.experiments.rendering import render
from tessera_cli.experiments.series import NOT_KEPT, measure_all
from tessera_cli.files import python_command

EVENTS = "events.csv"
# Of a recorded run: enough for a map that has settled, and not too much for a disk.
RECORDED_FRAMES = 240


@dataclass(frozen=True)
class RunOptions:
    """What is the same in all runs."""

    extractors: int
    frames: tuple[int, int]  # last exclusive; -1: to the end
    port: int

    def words(self, sequence: Sequence, source: str, path: Path) -> list[str]:
        """The command, without the program; the run's folder is `path`."""
        words = ["run", source, "--sensor", sequence.sensor, "--extractors", str(self.extractors)]
        words += ["--port", str(self.port), "--out", str(path)]
        if self.frames != (0, -1):
            words += ["--frames", f"{self.frames[0]}:{self.frames[1] if self.frames[1] >= 0 else ''}"]
        return words


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

    def render(self, sequence: Sequence, side: str) -> str:
        """The source to run."""
        return render(sequence, self._options.frames[1], self._sides[side], self._commands, self._view)

    def measure_all(self, runs: list[PlannedRun], sources: Mapping[tuple[str, str], str]) -> None:
        """`sources`: by key of the sequence and side. Raises RunError if a run fails."""

        def carry_out(run: PlannedRun) -> float:
            path, source = self._folder.run_path(run), sources[run.sequence.key, run.side]
            return self._run(self._sides[run.side], run.name, path, self._options.words(run.sequence, source, path))

        measure_all(self._folder, runs, carry_out, self._view)

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
                words = [*replace(self._options, frames=(first, last)).words(sequence, source, path), "--record"]
                self._run(self._sides[side], f"record_{name}", path, words)
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

    def _run(self, checkout: Checkout, name: str, path: Path, words: list[str]) -> float:
        """CPU seconds of the whole command. What an interrupted run left in `path` goes."""
        shutil.rmtree(path, ignore_errors=True)
        return self._commands.run(
            name, [*checkout.words, *words], checkout.folder, checkout.environment, self._view.look, path
        )
