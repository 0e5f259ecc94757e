"""What a person sees while an experiment runs: a line for each run, and in a terminal a bar with the time left."""

import sys
import time
from typing import Self

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from tessera_cli.constants import RUN_PANEL_PERIOD_S
from tessera_cli.experiments.plan import PlannedRun
from tessera_cli.supervision.progress import format_duration

Durations = dict[tuple[str, str], list[float]]  # seconds, by sequence and side


def time_left_s(remaining: list[PlannedRun], durations: Durations) -> float | None:
    """Each run takes as long as those of its sequence and side did, else of its sequence, else of any.

    None: no run has ended yet.
    """

    def expected_s(run: PlannedRun) -> float | None:
        of_side = durations.get((run.sequence.key, run.side), [])
        of_sequence = [value for (key, _), values in durations.items() if key == run.sequence.key for value in values]
        known = of_side or of_sequence or [value for values in durations.values() for value in values]
        return sum(known) / len(known) if known else None

    expected = [expected_s(run) for run in remaining]
    return None if None in expected else sum(value or 0.0 for value in expected)


class ProgressView:
    """Between entering and leaving its context. Without a terminal only the lines are printed."""

    def __init__(self) -> None:
        self._console = Console()
        self._live = Live(console=self._console, auto_refresh=False, transient=True) if sys.stdout.isatty() else None
        self._last = 0.0
        self._task, self._done, self._total = "", 0, 0
        self._left_s: float | None = None

    def __enter__(self) -> Self:
        if self._live:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live:
            self._live.stop()

    def say(self, sentence: str) -> None:
        if self._live:
            self._console.print(f"tessera: {sentence}", markup=False, highlight=False)
        else:
            print(f"tessera: {sentence}", flush=True)

    def begin(self, task: str, done: int = 0, total: int = 0, left_s: float | None = None) -> None:
        """`done` of `total` runs are over, 0: it is not one of them; `left_s`: what all others will take."""
        self._task, self._done, self._total, self._left_s = task, done, total, left_s
        self._began = time.monotonic()
        self._last = 0.0

    def look(self, line: str) -> None:
        """The last line that the present run has printed."""
        if self._live is None or time.monotonic() - self._last < RUN_PANEL_PERIOD_S:
            return
        self._last = time.monotonic()
        self._live.update(self._draw(line.removeprefix("tessera: ")), refresh=True)

    def _draw(self, line: str) -> Group:
        words = Text(f"{self._task}: {line}", overflow="ellipsis", no_wrap=True)
        if not self._total:
            return Group(words)
        row = Table.grid(padding=(0, 1), expand=True)
        row.add_column(ratio=1)
        row.add_column(justify="right", no_wrap=True)
        left_s = None if self._left_s is None else max(0.0, self._left_s - (time.monotonic() - self._began))
        counts = f"{self._done}/{self._total} runs  {format_duration(left_s)} left"
        row.add_row(ProgressBar(total=self._total, completed=self._done), counts)
        return Group(row, words)
