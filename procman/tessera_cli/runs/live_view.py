"""What a person sees during a run: a live panel in a terminal, a plain line every few seconds without one."""

import sys
import time
from typing import Protocol, Self

import numpy as np
from rich import box
from rich.console import Console, Group
from rich.live import Live
from rich.panel import Panel
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as ProgressBars
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from tessera_cli.console import say
from tessera_cli.constants import LINE_PERIOD_S, MAX_EXTRACTORS_SHOWN, RUN_PANEL_PERIOD_S
from tessera_cli.runs.dot_picture import dots_of, text_of
from tessera_cli.supervision.progress import RUNNING, STAGE_STATES, Progress, StageReport, format_duration

# Of the map from above, beside the processes where there is room.
MAP_COLUMNS, MAP_LINES = 36, 10
MIN_WIDTH_WITH_MAP = 112
MIN_PATH_POINTS = 10
STATE_STYLES = {"tracked": "bold green", "searching": "bold yellow", "lost": "bold red"}


class RunView(Protocol):
    """Shows a run between entering and leaving its context."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...

    def say(self, sentence: str) -> None: ...

    def update(self, progress: Progress) -> None: ...


class Counter(Protocol):
    """Shows a number that grows, between entering and leaving its context."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...

    def update(self, number: int) -> None: ...


def make_run_view(title: str) -> RunView:
    return RunPanel(title) if sys.stdout.isatty() else RunLines(title)


def make_counter(title: str, total: int | None) -> Counter:
    """Shows how many frames of `total` are done; None: the number is unknown."""
    return CounterBar(title, total) if sys.stdout.isatty() else CounterLines(title, total)


class _Context:
    """A view that has nothing to open or close."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass


class RunLines(_Context):
    """For logs and pipes."""

    def __init__(self, title: str) -> None:
        self._last = time.monotonic()
        say(title)

    def say(self, sentence: str) -> None:
        say(sentence)

    def update(self, progress: Progress) -> None:
        if time.monotonic() - self._last < LINE_PERIOD_S:
            return
        self._last = time.monotonic()
        time_left = f"{format_duration(progress.time_left_s)} left, " if progress.num_frames else ""
        say(
            f"frame {progress.num_done}{progress.of_all_frames}, {progress.frames_per_s:.1f}/s, "
            f"{time_left}{progress.state}, latency {progress.latency_text}, "
            f"{progress.num_keyframes} keyframes, {progress.num_landmarks} landmarks, {progress.num_loops} loops, "
            f"dropped {progress.dropped_text}"
        )


class CounterLines(_Context):
    """For logs and pipes."""

    def __init__(self, title: str, total: int | None) -> None:
        self._last = time.monotonic()
        self._title = title
        self._of_all = f" of {total}" if total else ""

    def update(self, number: int) -> None:
        if time.monotonic() - self._last >= LINE_PERIOD_S:
            self._last = time.monotonic()
            say(f"{self._title}: frame {number}{self._of_all}")


class CounterBar:
    """Redrawn in place."""

    def __init__(self, title: str, total: int | None) -> None:
        self._bars = ProgressBars(
            TextColumn("tessera: {task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("frames"),
            TimeRemainingColumn(),
            TextColumn("left"),
        )
        self._task = self._bars.add_task(title, total=total)

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def update(self, number: int) -> None:
        self._bars.update(self._task, completed=number)


class RunPanel:
    """Redrawn in place, as wide as the terminal; 80 columns are enough for all but the map."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._last = 0.0
        self._live = Live(console=Console(), auto_refresh=False, vertical_overflow="ellipsis")

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def say(self, sentence: str) -> None:
        self._live.console.print(f"tessera: {sentence}", markup=False, highlight=False)

    def update(self, progress: Progress) -> None:
        if time.monotonic() - self._last < RUN_PANEL_PERIOD_S:
            return
        self._last = time.monotonic()
        self._live.update(self._draw(progress), refresh=True)

    def _draw(self, progress: Progress) -> Panel:
        width = self._live.console.width
        stages: Table = _draw_stages(progress)
        if width >= MIN_WIDTH_WITH_MAP and len(progress.path) >= MIN_PATH_POINTS:
            stages = _beside(stages, _draw_map(progress))
        title = Text(self._title, overflow="ellipsis")
        return Panel(Group(_draw_bar(progress), _draw_state(progress), stages), title=title, box=box.ROUNDED)


def _draw_bar(progress: Progress) -> Table:
    row = Table.grid(padding=(0, 1), expand=True)
    row.add_column(ratio=1)
    row.add_column(justify="right", no_wrap=True)
    of_all = f"/{progress.num_frames}" if progress.num_frames else ""
    time_left = f"  {format_duration(progress.time_left_s)} left" if progress.num_frames else ""
    row.add_row(
        ProgressBar(total=progress.num_frames or None, completed=progress.num_done, pulse=not progress.num_frames),
        f"{progress.num_done}{of_all} frames  {progress.frames_per_s:5.1f}/s{time_left}",
    )
    return row


def _draw_state(progress: Progress) -> Text:
    """Two lines: what a controller asks, and what there is of a map."""
    state = progress.state
    text = Text(no_wrap=True, overflow="ellipsis")
    text.append(state, style=STATE_STYLES.get(state, "bold red" if progress.silent_s > 0 else "bold"))
    text.append(f"   latency {progress.latency_text}   dropped {progress.dropped_text}\n")
    text.append(
        f"{progress.num_keyframes:,} keyframes   {progress.num_landmarks:,} landmarks   "
        f"{progress.num_loops:,} {'loop' if progress.num_loops == 1 else 'loops'}"
    )
    return text


def _beside(left: Table, right: Text) -> Table:
    row = Table.grid(padding=(0, 2), expand=True)
    row.add_column(ratio=1)
    row.add_column(no_wrap=True)
    row.add_row(left, right)
    return row


def _draw_map(progress: Progress) -> Text:
    """The path so far from above, ahead is up."""
    (picture,) = dots_of([np.array(progress.path)], MAP_COLUMNS, MAP_LINES)
    return Text(text_of(picture), style="bright_blue")


def _draw_stages(progress: Progress) -> Table:
    table = Table(box=box.SIMPLE_HEAD, expand=True, padding=(0, 1), pad_edge=False)
    table.add_column("process", no_wrap=True)
    table.add_column("state", no_wrap=True)
    for heading in ("queue", "step ms", "CPU %", "MB", "errors"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in _stage_rows(progress):
        table.add_row(*(Text(cell) for cell in row))  # texts as they are: in words, [red] would be a color
    return table


def _stage_rows(progress: Progress) -> list[tuple[str, ...]]:
    reports = sorted(progress.stages.values(), key=lambda report: report.name)
    extractors = [report for report in reports if report.name.startswith("extractor_")]
    if len(extractors) <= MAX_EXTRACTORS_SHOWN:
        return [_row(report) for report in reports]
    return [_combined_row(extractors)] + [_row(report) for report in reports if report not in extractors]


def _row(report: StageReport) -> tuple[str, ...]:
    return (
        report.name,
        STAGE_STATES[report.state],
        str(report.queue),
        f"{report.step_ms:.2f}",
        f"{report.cpu_percent:.0f}",
        f"{report.rss_mb:.0f}",
        str(report.num_errors),
    )


def _combined_row(reports: list[StageReport]) -> tuple[str, ...]:
    """All extractors as one: sums, and the mean of their step times."""
    num_running = sum(report.state == RUNNING for report in reports)
    step_ms = sum(report.step_ms for report in reports) / len(reports)
    return (
        f"extractors ({len(reports)})",
        f"{num_running} run",
        str(sum(report.queue for report in reports)),
        f"{step_ms:.2f}",
        f"{sum(report.cpu_percent for report in reports):.0f}",
        f"{sum(report.rss_mb for report in reports):.0f}",
        str(sum(report.num_errors for report in reports)),
    )
