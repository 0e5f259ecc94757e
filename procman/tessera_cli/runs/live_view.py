"""What a person sees while a run goes on: one live panel in a terminal, a plain line every few seconds without one."""

import sys
import time

from tessera_cli.supervision.progress import STATE_NAMES, Progress, StageReport

PANEL_PERIOD_S = 0.25
LINE_PERIOD_S = 5.0
# Above this number, the extractors share one row.
MAX_EXTRACTOR_ROWS = 4


def make_view(title: str):
    return Panel(title) if sys.stdout.isatty() else Lines(title)


def make_count(title: str, total: int | None):
    """Shows how many frames of `total` are done; None: nobody knows how many there will be."""
    return CountBar(title, total) if sys.stdout.isatty() else CountLines(title, total)


def describe_time(seconds: float | None) -> str:
    if seconds is None:
        return "-:--"
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


class Lines:
    """For logs and pipes."""

    def __init__(self, title: str) -> None:
        self._last = time.monotonic()
        print(f"tessera: {title}", flush=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def say(self, sentence: str) -> None:
        print(f"tessera: {sentence}", flush=True)

    def update(self, progress: Progress) -> None:
        if time.monotonic() - self._last < LINE_PERIOD_S:
            return
        self._last = time.monotonic()
        of_all = f" of {progress.num_frames}" if progress.num_frames else ""
        print(
            f"tessera: frame {progress.num_poses}{of_all}, {progress.frames_per_s:.1f}/s, "
            f"{describe_time(progress.time_left_s)} left, {progress.tracking_state or 'no pose yet'}, "
            f"{progress.num_keyframes} keyframes, {progress.num_landmarks} landmarks, {progress.num_loops} loops, {progress.num_dropped} dropped",
            flush=True,
        )


class CountLines:
    """One number that grows, for logs and pipes."""

    def __init__(self, title: str, total: int | None) -> None:
        self._last = time.monotonic()
        self._title = title
        self._of_all = f" of {total}" if total else ""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def update(self, number: int) -> None:
        if time.monotonic() - self._last >= LINE_PERIOD_S:
            self._last = time.monotonic()
            print(f"tessera: {self._title}: frame {number}{self._of_all}", flush=True)


class CountBar:
    """The same as a bar, redrawn in place."""

    def __init__(self, title: str, total: int | None) -> None:
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
        from rich.progress import Progress as Bars

        self._bars = Bars(
            TextColumn("tessera: {task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("frames"),
            TimeRemainingColumn(),
            TextColumn("left"),
        )
        self._task = self._bars.add_task(title, total=total)

    def __enter__(self):
        self._bars.start()
        return self

    def __exit__(self, *_):
        self._bars.stop()

    def update(self, number: int) -> None:
        self._bars.update(self._task, completed=number)


class Panel:
    """Redrawn in place. Fits 80 columns."""

    def __init__(self, title: str) -> None:
        from rich.console import Console
        from rich.live import Live

        self._title = title
        self._last = 0.0
        self._live = Live(console=Console(), auto_refresh=False, vertical_overflow="ellipsis")

    def __enter__(self):
        self._live.start()
        return self

    def __exit__(self, *_):
        self._live.stop()

    def say(self, sentence: str) -> None:
        self._live.console.print(f"tessera: {sentence}", markup=False, highlight=False)

    def update(self, progress: Progress) -> None:
        if time.monotonic() - self._last < PANEL_PERIOD_S:
            return
        self._last = time.monotonic()
        self._live.update(self._draw(progress), refresh=True)

    def _draw(self, progress: Progress):
        from rich import box
        from rich.console import Group
        from rich.panel import Panel as Frame
        from rich.text import Text

        content = Group(_draw_bar(progress), Text(_tracking_line(progress)), _draw_stages(progress))
        return Frame(
            content,
            title=Text(self._title, overflow="ellipsis"),
            box=box.ROUNDED,
            width=min(80, self._live.console.width),
        )


def _draw_bar(progress: Progress):
    from rich.progress_bar import ProgressBar
    from rich.table import Table

    row = Table.grid(padding=(0, 1), expand=True)
    row.add_column(ratio=1)
    row.add_column(justify="right", no_wrap=True)
    of_all = f"/{progress.num_frames}" if progress.num_frames else ""
    figures = f"{progress.num_poses}{of_all} frames  {progress.frames_per_s:5.1f}/s  {describe_time(progress.time_left_s)} left"
    row.add_row(
        ProgressBar(total=progress.num_frames or None, completed=progress.num_poses, pulse=not progress.num_frames),
        figures,
    )
    return row


def _tracking_line(progress: Progress) -> str:
    return (
        f"tracking: {progress.tracking_state or 'no pose yet'}  keyframes: {progress.num_keyframes}  "
        f"landmarks: {progress.num_landmarks}  loops: {progress.num_loops}  dropped: {progress.num_dropped}"
    )


def _draw_stages(progress: Progress):
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, expand=True, padding=(0, 1), pad_edge=False)
    table.add_column("process", no_wrap=True)
    table.add_column("state", no_wrap=True)
    for heading in ("queue", "step ms", "CPU %", "MB", "errors"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in _stage_rows(progress):
        table.add_row(*row)
    return table


def _stage_rows(progress: Progress) -> list[tuple[str, ...]]:
    reports = sorted(progress.stages.values(), key=lambda report: report.name)
    extractors = [report for report in reports if report.name.startswith("extractor_")]
    others = [report for report in reports if report not in extractors]
    if len(extractors) > MAX_EXTRACTOR_ROWS:
        return [_combined_row(extractors)] + [_row(report) for report in others]
    return [_row(report) for report in reports]


def _row(report: StageReport) -> tuple[str, ...]:
    return (
        report.name,
        STATE_NAMES[report.state],
        str(report.queue),
        f"{report.step_ms:.2f}",
        f"{report.cpu_percent:.0f}",
        f"{report.rss_mb:.0f}",
        str(report.num_errors),
    )


def _combined_row(reports: list[StageReport]) -> tuple[str, ...]:
    """All extractors as one: sums, and the mean of their step times."""
    running = sum(report.state == 1 for report in reports)
    step_ms = sum(report.step_ms for report in reports) / len(reports)
    return (
        f"extractors ({len(reports)})",
        f"{running} run",
        str(sum(report.queue for report in reports)),
        f"{step_ms:.2f}",
        f"{sum(report.cpu_percent for report in reports):.0f}",
        f"{sum(report.rss_mb for report in reports):.0f}",
        str(sum(report.num_errors for report in reports)),
    )
