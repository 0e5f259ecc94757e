"""Experiment cores: the frame rate against the number of cores, and the bounds that the work itself sets it.

With W the CPU time of a frame over all processes, and w that of the process that takes most (it can't be divided), n
cores make at most

    frames per second <= min(n / W, 1 / w)

The first bound rises with cores; from W / w cores on, the second one holds, however many there are.
"""

import csv
import json
import os
from argparse import Namespace
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from tessera_cli.console import say
from tessera_cli.errors import UserError
from tessera_cli.experiments.checkouts import this_checkout
from tessera_cli.experiments.commands import CommandRunner
from tessera_cli.experiments.measurements import cpu_ms_of, measure
from tessera_cli.experiments.plan import Sequence, check_out, sequences_of
from tessera_cli.experiments.progress_view import ProgressView
from tessera_cli.experiments.rendering import render
from tessera_cli.experiments.runner import RunOptions
from tessera_cli.experiments.targets import STANDARD
from tessera_cli.files import absolute, replacing
from tessera_cli.interrupt import Interrupt
from tessera_cli.runs.run_folder import Summary, new_folder

NAME = "experiment-cores"


@dataclass(frozen=True)
class Work:
    """CPU time of a frame, ms."""

    all_ms: float
    largest: str  # the process that takes most
    largest_ms: float

    def bound(self, cores: int) -> tuple[float, str]:
        """Frames per second at most, and what sets them."""
        by_cores, by_process = 1000.0 * cores / self.all_ms, 1000.0 / self.largest_ms
        return (by_cores, "cores") if by_cores < by_process else (by_process, self.largest)


@dataclass(frozen=True)
class Row:
    """One sequence on so many cores."""

    sequence: str
    cores: int
    frames_per_s: float | None  # None: the machine has fewer cores
    bound_frames_per_s: float
    bound_by: str
    is_same: bool | None  # trajectory and map, as on the fewest cores


def measure_cores(arguments: Namespace) -> int:
    """`tessera experiment cores`. Exit status 1 if the number of cores changed a result."""
    sequences = sequences_of(arguments, STANDARD)
    check_out(arguments.out, arguments.force)
    folder = absolute(arguments.out) if arguments.out else new_folder(NAME)
    folder.mkdir(parents=True, exist_ok=True)
    commands = CommandRunner(folder / "logs", Interrupt())
    rows: list[Row] = []
    with ProgressView() as view:
        for sequence in sequences:
            source = render(sequence, arguments.frames[1], this_checkout(), commands, view)
            summaries = {}
            for cores in cores_that_are_there(arguments.cores):
                view.say(f"{sequence.title} on {cores} of {len(os.sched_getaffinity(0))} cores")
                view.begin("running")
                path = folder / "runs" / f"{sequence.key}_{cores}"
                summaries[cores] = _run(sequence, source, cores, arguments, commands, path, view)
            rows += tabulate(sequence, summaries, arguments.cores)
    _write(folder, rows)
    _print(rows)
    print(f"Table and runs: {folder}")
    return 1 if any(row.is_same is False for row in rows) else 0


def cores_that_are_there(wanted: Iterable[int]) -> list[int]:
    """Raises UserError if this machine has none of these numbers of cores."""
    available = len(os.sched_getaffinity(0))
    there = sorted({cores for cores in wanted if cores <= available})
    if not there:
        raise UserError(f"--cores: this machine has {available} cores; name that number or a smaller one, too.")
    return there


def _run(
    sequence: Sequence,
    source: str,
    cores: int,
    arguments: Namespace,
    commands: CommandRunner,
    path: Path,
    view: ProgressView,
) -> Summary:
    """On the first `cores` of those that this command may use. Raises RunError if the run fails."""
    here, options = this_checkout(), RunOptions(arguments.extractors, arguments.frames, arguments.port)
    words = [*options.words(sequence, source, path), "--force"]
    chosen = ",".join(map(str, sorted(os.sched_getaffinity(0))[:cores]))
    words = ["taskset", "-c", chosen, *here.words, *words]
    commands.run(path.name, words, here.folder, here.environment, view.look, path)
    summary: Summary = json.loads((path / "summary.json").read_text())
    return summary


def tabulate(sequence: Sequence, summaries: dict[int, Summary], wanted: Iterable[int]) -> list[Row]:
    """`summaries`: of the runs, by cores. What a frame takes is read from the run on most cores."""
    work = work_of(summaries[max(summaries)])
    results = {cores: measure(summary).hashes for cores, summary in summaries.items()}
    rows = []
    for cores in sorted(set(wanted)):
        bound, bound_by = work.bound(cores)
        summary = summaries.get(cores)
        rows.append(
            Row(
                sequence.title,
                cores,
                summary["frames_per_s"] if summary else None,
                bound,
                bound_by,
                results[cores] == results[min(results)] if summary else None,
            )
        )
    return rows


def work_of(summary: Summary) -> Work:
    """Each extractor is a process of its own."""
    cpu_ms = cpu_ms_of(summary)
    largest = max(cpu_ms, key=lambda name: (cpu_ms[name], name))
    return Work(sum(cpu_ms.values()), largest, cpu_ms[largest])


def _write(folder: Path, rows: list[Row]) -> None:
    with replacing(folder / "cores.csv") as path, open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Row)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def _print(rows: list[Row]) -> None:
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("sequence", "cores", "frames/s", "at most", "by", "of that"):
        table.add_column(heading, justify="left" if heading in ("sequence", "by") else "right")
    for row in rows:
        measured = "–" if row.frames_per_s is None else f"{row.frames_per_s:.1f}"
        share = "–" if row.frames_per_s is None else f"{100 * row.frames_per_s / row.bound_frames_per_s:.0f} %"
        table.add_row(row.sequence, str(row.cores), measured, f"{row.bound_frames_per_s:.1f}", row.bound_by, share)
    Console().print(table)
    if any(row.is_same is False for row in rows):
        say("trajectory or map differ between numbers of cores: this must not be.")
