"""The table of faults: a row for each process and kind of fault, on the terminal, as CSV and as JSON."""

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from tessera_cli.constants import FAULT_KINDS
from tessera_cli.experiments.faults.outcome import COMPLETE, Outcome, ThrownFault
from tessera_cli.experiments.faults.schedule import LOSS, SLOW, STOP
from tessera_cli.experiments.tables import NOTHING
from tessera_cli.report.drawing import in_order

MEANINGS = {"kill": "killed", STOP: "stopped", SLOW: "slowed down", LOSS: "packets lost"}
HEADINGS = ("process", "fault", "thrown", "same result", "ended runs", "longest pause [s]")


@dataclass(frozen=True)
class Row:
    """Of one process and one kind of fault, or of all."""

    process: str
    fault: str
    num_thrown: int
    num_runs: int  # in which it was thrown
    num_like: int  # of these, that ended with the undisturbed trajectory and map
    num_ended: int  # of these, that failed after it as the last fault
    longest_pause_s: float | None  # None: no pose followed any of them

    @property
    def is_good(self) -> bool:
        return self.num_like == self.num_runs

    @property
    def cells(self) -> list[str]:
        pause = NOTHING if self.longest_pause_s is None else f"{self.longest_pause_s:.1f}"
        like = f"{self.num_like} of {self.num_runs}"
        return [self.process, self.fault, str(self.num_thrown), like, str(self.num_ended), pause]


def make_rows(undisturbed: Outcome, runs: Sequence[Outcome]) -> list[Row]:
    """In the order of the data flow; the last row is of all faults."""
    keys = {(fault.kind_of_process, fault.kind) for run in runs for fault in run.faults}
    rows = [
        _row(process, kind, undisturbed, runs)
        for process in in_order({process for process, _ in keys})
        for kind in FAULT_KINDS
        if (process, kind) in keys
    ]
    return [*rows, _row("all", "", undisturbed, runs)]


def _row(process: str, kind: str, undisturbed: Outcome, runs: Sequence[Outcome]) -> Row:
    """An empty kind stands for all faults of all processes."""

    def is_meant(fault: ThrownFault) -> bool:
        return not kind or (fault.kind_of_process, fault.kind) == (process, kind)

    chosen = [run for run in runs if any(is_meant(fault) for fault in run.faults)]
    faults = [fault for run in chosen for fault in run.faults if is_meant(fault)]
    pauses = [fault.pause_s for fault in faults if fault.pause_s is not None]
    return Row(
        process=process,
        fault=MEANINGS.get(kind, ""),
        num_thrown=len(faults),
        num_runs=len(chosen),
        num_like=sum(run.is_like(undisturbed) for run in chosen),
        num_ended=sum(run.ended != COMPLETE and is_meant(run.faults[-1]) for run in chosen),
        longest_pause_s=max(pauses, default=None),
    )


def headline(undisturbed: Outcome, runs: Sequence[Outcome]) -> list[str]:
    """Sentences, the most important first."""
    num_like, num_faults = sum(run.is_like(undisturbed) for run in runs), sum(len(run.faults) for run in runs)
    sentences = [
        f"{num_like} of {len(runs)} runs with {num_faults} faults ended with the undisturbed trajectory and map.",
        f"Without faults, the longest pause between two poses was {undisturbed.longest_pause_s:.1f} s.",
    ]
    for number, run in enumerate(runs, start=1):
        if run.ended != COMPLETE:
            sentences.append(f"Run {number} did not end well: {run.ended}")
        elif not run.is_like(undisturbed):
            sentences.append(f"Run {number} has another trajectory or map.")
    return sentences


def print_table(rows: Sequence[Row]) -> None:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    for heading in HEADINGS:
        is_text = heading in HEADINGS[:2]
        table.add_column(Text(heading), justify="left" if is_text else "right", no_wrap=is_text)
    for row in rows:
        if row is rows[-1]:
            table.add_section()
        texts = [Text(cell) for cell in row.cells]
        texts[3].append(*((" ✓", "green") if row.is_good else (" ✗", "red")))
        table.add_row(*texts)
    Console().print(table)


def as_csv(undisturbed: Outcome, runs: Sequence[Outcome]) -> str:
    """A row for each fault."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(["run", "process", "fault", "frame", "began_s", "ended_s", "pause_s", "run_is_like_undisturbed"])
    for number, run in enumerate(runs, start=1):
        for fault in run.faults:
            times = [f"{fault.began_s:.3f}", f"{fault.ended_s:.3f}"]
            pause = "" if fault.pause_s is None else f"{fault.pause_s:.3f}"
            like = str(run.is_like(undisturbed)).lower()
            writer.writerow([number, fault.process, fault.kind, fault.frame, *times, pause, like])
    return text.getvalue()


def as_json(undisturbed: Outcome, runs: Sequence[Outcome]) -> dict[str, Any]:
    return {
        "rows": [asdict(row) for row in make_rows(undisturbed, runs)],
        "undisturbed": asdict(undisturbed),
        "runs": [{**asdict(run), "is_like_undisturbed": run.is_like(undisturbed)} for run in runs],
    }
