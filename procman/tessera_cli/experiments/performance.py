"""Experiment performance: speed, CPU time, accuracy and repeatability of whole runs, against another commit."""

import json
import os
from argparse import Namespace
from pathlib import Path
from typing import Any

from tessera_cli.experiments.checkouts import Checkout, other_checkout, this_checkout
from tessera_cli.experiments.commands import CommandRunner
from tessera_cli.experiments.comparison_page import headline, write_comparison_page
from tessera_cli.experiments.events import read_events
from tessera_cli.experiments.gantt import draw_gantt
from tessera_cli.experiments.measurements import is_repeatable, measure
from tessera_cli.experiments.plan import (
    THAT,
    THIS,
    ExperimentFolder,
    PlannedRun,
    Sequence,
    alternate,
    check_out,
    open_folder,
    sequences_of,
)
from tessera_cli.experiments.progress_view import ProgressView
from tessera_cli.experiments.runner import EVENTS, ExperimentRunner, RunOptions
from tessera_cli.experiments.series import disturbances
from tessera_cli.experiments.tables import Comparison, as_csv, as_json, print_table
from tessera_cli.experiments.targets import STANDARD
from tessera_cli.experiments.timeline import reconstruct
from tessera_cli.files import write_text
from tessera_cli.interrupt import Interrupt
from tessera_cli.report.drawing import Drawing
from tessera_cli.runs.run_folder import read_settings

NAME = "experiment-performance"
WHOLE = (0, -1)


def measure_performance(arguments: Namespace) -> int:
    """`tessera experiment performance`."""
    sequences = sequences_of(arguments, STANDARD)
    check_out(arguments.out, arguments.force)
    interrupt = Interrupt()
    with ProgressView() as view:
        sides = _checkouts(arguments.against, interrupt, view)
        description = _describe(arguments, sequences, sides)
        folder, continues = open_folder(arguments.out, NAME, description, arguments.force)
        commands = CommandRunner(folder.logs, interrupt)
        if not continues:
            folder.begin(description)
        for side, checkout in sides.items():
            view.say(f"{side}: {checkout.name}, {checkout.folder}")
        runs = alternate(sequences, list(sides), arguments.repetitions)
        options = RunOptions(arguments.extractors, arguments.frames, arguments.port)
        runner = ExperimentRunner(folder, commands, sides, options, view)
        try:
            _carry_out(runner, sequences, runs, list(sides), with_timeline=not arguments.no_timeline)
        except BaseException:
            view.say(f"what is done is kept: the same command with --out {folder.path} continues it")
            raise
    return _present(folder, sequences, runs, sides, is_whole=arguments.frames == WHOLE)


def _checkouts(against: str | None, interrupt: Interrupt, view: ProgressView) -> dict[str, Checkout]:
    sides = {THIS: this_checkout()}
    if against is not None:
        view.begin(f"building {against}")
        sides[THAT] = other_checkout(against, interrupt, view.look)
    return sides


def _describe(arguments: Namespace, sequences: list[Sequence], sides: dict[str, Checkout]) -> dict[str, Any]:
    """What must be the same for runs to be put together; more repetitions may be added."""
    return {
        "experiment": "performance",
        "sequences": [{"name": each.name, "sensor": each.sensor, "source": each.source} for each in sequences],
        **{side: each.fingerprint() for side, each in sides.items()},
        "frames": list(arguments.frames),
        "extractors": arguments.extractors,
    }


def _carry_out(
    runner: ExperimentRunner, sequences: list[Sequence], runs: list[PlannedRun], sides: list[str], with_timeline: bool
) -> None:
    sources = {(sequence.key, side): runner.render(sequence, side) for sequence in sequences for side in sides}
    for sequence in sequences if with_timeline else []:
        for side in sides:
            runner.record_events(sequence, side, sources[sequence.key, side])
    runner.measure_all(runs, sources)


def _present(
    folder: ExperimentFolder,
    sequences: list[Sequence],
    runs: list[PlannedRun],
    sides: dict[str, Checkout],
    is_whole: bool,
) -> int:
    """Prints the table and writes the results. Returns the exit status."""
    against = sides[THAT].commit if THAT in sides else None
    comparisons = [_compare(folder, sequence, runs, against, is_whole) for sequence in sequences]
    remarks = disturbances(folder, runs)
    ways = [_draw_way(folder, sequence, sides) for sequence in sequences]
    names = [checkout.name for checkout in sides.values()]
    results = {
        "this": names[0],
        "that": names[1] if THAT in sides else None,
        "remarks": remarks,
        "sequences": as_json(comparisons),
    }
    write_text(folder.path / "performance.json", json.dumps(results, indent=2) + "\n")
    write_text(folder.path / "performance.csv", as_csv(comparisons))
    write_comparison_page(folder.path / "performance.html", names, comparisons, ways, remarks)
    print_table(comparisons)
    for sentence in [*headline(comparisons), *remarks]:
        print(sentence)
    print(f"table and page: {folder.path / 'performance.html'}")
    repeatable = all(is_repeatable(each.this) and is_repeatable(each.that) for each in comparisons)
    return 0 if repeatable else 1


def _compare(
    folder: ExperimentFolder, sequence: Sequence, runs: list[PlannedRun], against: str | None, is_whole: bool
) -> Comparison:
    def measured(side: str) -> list[Any]:
        chosen = [run for run in runs if run.sequence == sequence and run.side == side]
        return [measure(summary) for run in chosen if (summary := folder.summary(run))]

    cores = len(os.sched_getaffinity(0))
    return Comparison(sequence, measured(THIS), measured(THAT), cores, is_whole, against)


def _draw_way(folder: ExperimentFolder, sequence: Sequence, sides: dict[str, Checkout]) -> Drawing | None:
    """None where nothing was recorded."""
    steps_of = {}
    for side, checkout in sides.items():
        path = folder.recording_path(sequence, side)
        if (path / EVENTS).is_file():
            steps_of[f"{side}, {checkout.name}"] = reconstruct(read_events(path / EVENTS), _loop_delay(path))
    return draw_gantt(sequence.title, steps_of)


def _loop_delay(path: Path) -> int | None:
    """The setting of a run; None if it closed no loops."""
    mapper = read_settings(path / "settings.yaml").get("mapper", {})
    return mapper.get("loop_delay_keyframes") if mapper.get("close_loops", True) else None
