"""The table of a comparison: its rows, on the terminal, as CSV and as JSON."""

import csv
import io
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from tessera_cli.experiments.measurements import (
    Measurement,
    Spread,
    find_limit,
    is_repeatable,
    largest_part,
    spread,
)
from tessera_cli.experiments.plan import Sequence
from tessera_cli.experiments.targets import Target, cpu_target, error_target, speed_target
from tessera_cli.report.drawing import in_order

NOTHING = "–"
# Terminals at least this wide show the spread too.
WIDE = 110
NARROWEST = 80
HASH_DIGITS = 8
# Processes that take less than this of the CPU time of both commits are not worth a row.
SMALL_SHARE = 0.005


@dataclass(frozen=True)
class Value:
    """A figure of one commit."""

    text: str
    spread_text: str = ""  # empty: all runs are alike
    spread: Spread | None = None


@dataclass(frozen=True)
class Row:
    """One figure of one sequence."""

    figure: str
    this: Value | None
    that: Value | None
    target: str = ""
    ratio: str = ""  # this / that
    is_met: bool | None = None  # None: there is no target, or nothing to compare with it
    limit: str = ""
    is_part: bool = False  # of the figure above it


@dataclass(frozen=True)
class Comparison:
    """Of one sequence. `that` is empty where only one commit is measured."""

    sequence: Sequence
    this: list[Measurement]
    that: list[Measurement]
    cores: int
    is_whole: bool  # no --frames
    against: str | None  # the full hash of the other commit

    def rows(self) -> list[Row]:
        typical = sorted(self.this, key=lambda run: run.frames_per_s)[len(self.this) // 2]
        wait = f"map wait {typical.map_wait_ms:.1f} ms" if typical.map_wait_ms is not None else ""
        rows = [
            self._row(
                "frames/s",
                lambda run: run.frames_per_s,
                "{:.1f}",
                speed_target(self.sequence, self.against),
                find_limit(typical, self.cores),
            ),
            self._row(
                "CPU ms a frame",
                lambda run: run.all_cpu_ms,
                "{:.1f}",
                cpu_target(self.sequence, self.against),
                largest_part(typical.cpu_ms),
            ),
            *self._cpu_rows(),
            self._row("keyframes", lambda run: float(run.keyframes), "{:.0f}"),
            self._row("RMS error [m]", lambda run: run.error_m, "{:.4f}", error_target(self.sequence, self.is_whole)),
            self._row("latency [ms]", lambda run: run.latency_median_ms, "{:.0f}", limit=wait),
            self._row("latency 95 % [ms]", lambda run: run.latency_p95_ms, "{:.0f}"),
            self._hash_row(),
        ]
        return [row for row in rows if row.this or row.that]

    def _row(
        self,
        figure: str,
        read: Callable[[Measurement], float | None],
        pattern: str,
        target: Target | None = None,
        limit: str = "",
        is_part: bool = False,
    ) -> Row:
        this, that = (spread(read(run) for run in runs) for runs in (self.this, self.that))
        ratio = this.median / that.median if this and that and that.median > 0 else None
        judged = ratio if target and target.is_ratio else this.median if this else None
        return Row(
            figure=figure,
            this=_value(this, pattern),
            that=_value(that, pattern),
            target=target.text if target else "",
            ratio="" if ratio is None else f"{ratio:.2f}x",
            is_met=target.is_met(judged) if target and judged is not None else None,
            limit=limit,
            is_part=is_part,
        )

    def _cpu_rows(self) -> list[Row]:
        """One for each kind of process, in the order of the data flow."""

        def read(name: str) -> Callable[[Measurement], float]:
            return lambda run: run.cpu_ms.get(name, 0.0)

        all_ms = max(run.all_cpu_ms for run in [*self.this, *self.that])
        rows = []
        for name in in_order({name for run in [*self.this, *self.that] for name in run.cpu_ms}):
            if max(read(name)(run) for run in [*self.this, *self.that]) >= SMALL_SHARE * all_ms:
                rows.append(self._row(name, read(name), "{:.1f}", is_part=True))
        return rows

    def _hash_row(self) -> Row:
        this, that = (_hash_value(runs) for runs in (self.this, self.that))
        ratio = ""
        if self.this and self.that and is_repeatable(self.this) and is_repeatable(self.that):
            ratio = "same" if self.this[0].hashes == self.that[0].hashes else "changed"
        return Row("trajectory, map", this, that, target="equal", ratio=ratio, is_met=is_repeatable(self.this))


def _value(found: Spread | None, pattern: str) -> Value | None:
    if found is None:
        return None
    low, high = pattern.format(found.lowest), pattern.format(found.highest)
    return Value(pattern.format(found.median), "" if low == high else f"{low}..{high}", found)


def _hash_value(runs: list[Measurement]) -> Value | None:
    """The first digits of the trajectory's hash where all are equal."""
    if not runs:
        return None
    different = len({run.hashes for run in runs})
    if different > 1:
        return Value(f"{different} different")
    return Value(runs[0].hashes[0][:HASH_DIGITS] or "unknown", f"equal, {len(runs)} runs" if len(runs) > 1 else "1 run")


def print_table(comparisons: list[Comparison], width: int | None = None) -> None:
    """`width`: of the terminal, by default the real one's."""
    console = Console()
    console.width = max(width or console.width, NARROWEST)
    is_wide, has_that = console.width >= WIDE, any(comparison.that for comparison in comparisons)
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    table.add_column("figure", no_wrap=True)
    table.add_column("target", justify="right", no_wrap=True)
    table.add_column("this", justify="right", no_wrap=True)
    if has_that:
        table.add_column("that", justify="right", no_wrap=True)
        table.add_column("ratio", justify="right", no_wrap=True)
    table.add_column("what limits it", overflow="fold")
    for comparison in comparisons:
        table.add_section()
        table.add_row(Text(comparison.sequence.title, style="bold"))
        for row in comparison.rows():
            table.add_row(*_cells(row, is_wide, has_that))
    console.print(table)


def _cells(row: Row, is_wide: bool, has_that: bool) -> list[Text]:
    def show(value: Value | None) -> Text:
        if value is None:
            return Text(NOTHING)
        text = Text(value.text)
        return text.append(f" ({value.spread_text})", style="dim") if is_wide and value.spread_text else text

    name = Text(f"  {row.figure}" if row.is_part else row.figure, style="dim" if row.is_part else "")
    comparison = [show(row.that), Text(row.ratio)] if has_that else []
    limit = Text(row.limit if is_wide else row.limit.replace(", ", "\n"))
    return [name, Text(row.target).append(*_verdict(row)), show(row.this), *comparison, limit]


def _verdict(row: Row) -> tuple[str, str]:
    """A mark and its style."""
    if row.is_met is None:
        return ("", "")
    return (" ✓", "green") if row.is_met else (" ✗", "red")


def as_csv(comparisons: list[Comparison]) -> str:
    text = io.StringIO()
    writer = csv.writer(text)
    statistics = [f"{side}_{name}" for side in ("this", "that") for name in ("median", "min", "max")]
    writer.writerow(["sequence", "sensor", "figure", *statistics, "ratio", "target", "is_met", "limit"])
    for comparison in comparisons:
        for row in comparison.rows():
            figure = f"CPU ms a frame: {row.figure}" if row.is_part else row.figure
            numbers = [number for value in (row.this, row.that) for number in _numbers(value)]
            met = "" if row.is_met is None else str(row.is_met).lower()
            names = [comparison.sequence.name, comparison.sequence.sensor, figure]
            writer.writerow([*names, *numbers, row.ratio.removesuffix("x"), row.target, met, row.limit])
    return text.getvalue()


def _numbers(value: Value | None) -> list[Any]:
    if value is None:
        return ["", "", ""]
    if value.spread is None:
        return [value.text, "", ""]
    return [value.spread.median, value.spread.lowest, value.spread.highest]


def as_json(comparisons: list[Comparison]) -> list[dict[str, Any]]:
    """For each sequence: its rows, and every run's own figures."""
    return [
        {
            "sequence": comparison.sequence.name,
            "sensor": comparison.sequence.sensor,
            "source": comparison.sequence.source,
            "rows": [asdict(row) for row in comparison.rows()],
            "this": [asdict(run) for run in comparison.this],
            "that": [asdict(run) for run in comparison.that],
        }
        for comparison in comparisons
    ]
