"""tessera watch: nodes and processes, how fast the poses of each list come, and what processes say, drawn anew twice a second until Ctrl-C."""

import sys
import time
from argparse import Namespace
from collections import deque

from tessera_cli.interrupt import Interrupt
from tessera_cli.messages import procman_output_t, procman_process_t, stage_status_t
from tessera_cli.supervision.list_monitor import ListView
from tessera_cli.supervision.sheriff import Sheriff
from tessera_cli.supervision.sheriff_commands import describe_list, print_status
from tessera_cli.supervision.supervised_process import STATE_NAMES

PANEL_PERIOD_S = 0.5
LINES_PERIOD_S = 5.0
NUM_LINES = 6
STYLES = {
    procman_process_t.READY: "green",
    procman_process_t.FINISHED: "green",
    procman_process_t.FAILED: "bold red",
    procman_process_t.BACKING_OFF: "yellow",
    procman_process_t.WAITING: "yellow",
    procman_process_t.STARTING: "yellow",
}


def main(arguments: Namespace) -> int:
    watcher = Watcher(arguments)
    interrupt = Interrupt()
    return watcher.draw_until(interrupt) if sys.stdout.isatty() else watcher.print_until(interrupt)


class Watcher:
    def __init__(self, arguments: Namespace) -> None:
        self._sheriff = Sheriff(arguments)
        self._sheriff.on_output(self._on_output)
        self._views: dict[tuple[str, str, str], ListView] = {}  # by list, bus and prefix
        self._lines: deque[str] = deque(maxlen=NUM_LINES)

    def _on_output(self, output: procman_output_t) -> None:
        if not output.order:
            self._lines.extend(f"{output.process}: {line}" for line in output.text.splitlines())

    def _follow_lists(self) -> None:
        """Listens to lists that came, and no longer to those that went."""
        wanted = {
            (each.name, each.main_url, each.channel_prefix)
            for heard in self._sheriff.deputies.values()
            for each in heard.status.lists
        }
        self._views = {key: self._views.get(key) or ListView(*key[1:]) for key in sorted(wanted)}
        self._sheriff.also_listen_to([view.bus for view in self._views.values()])

    def _listen(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        while (left_s := until - time.monotonic()) > 0:
            self._sheriff.listen(min(left_s, 0.05))
            self._follow_lists()

    def print_until(self, interrupt: Interrupt) -> int:
        """For logs and pipes."""
        while not interrupt.requested:
            self._listen(LINES_PERIOD_S)
            print("\n".join(self._progress_lines()))
            print_status(self._sheriff)
            sys.stdout.flush()
        return 0

    def draw_until(self, interrupt: Interrupt) -> int:
        from rich.live import Live

        with Live(auto_refresh=False, screen=True) as live:
            while not interrupt.requested:
                self._listen(PANEL_PERIOD_S)
                live.update(self._draw(), refresh=True)
        return 0

    def _progress_lines(self) -> list[str]:
        """One for each list whose tracker speaks."""
        lines = [f"{name}: {words}" for (name, _, _), view in self._views.items() if (words := view.in_words())]
        return lines or ["no pose yet"]

    def _draw(self):
        from rich import box
        from rich.console import Group
        from rich.panel import Panel
        from rich.text import Text

        lines = Text("\n".join(self._lines) or "no output yet", style="dim", overflow="ellipsis", no_wrap=True)
        return Panel(
            Group(Text("\n".join(self._progress_lines())), self._draw_table(), lines),
            title="tessera watch",
            box=box.ROUNDED,
        )

    def _draw_table(self):
        from rich import box
        from rich.table import Table
        from rich.text import Text

        table = Table(box=box.SIMPLE_HEAD, expand=True, padding=(0, 1), pad_edge=False)
        for heading in ("process", "state"):
            table.add_column(heading, no_wrap=True)
        for heading in ("starts", "queue", "step ms", "CPU %", "MB"):
            table.add_column(heading, justify="right", no_wrap=True)
        table.add_column("reason", no_wrap=True, overflow="ellipsis", ratio=1)
        for deputy, heard in sorted(self._sheriff.deputies.items()):
            status = heard.status
            refused = sum(status.num_refused)
            said = "says nothing any more" if heard.is_silent else f"{refused} orders refused" if refused else ""
            table.add_row(
                Text(deputy, style="bold"),
                Text("silent" if heard.is_silent else "", style="bold red"),
                "",
                "",
                "",
                f"{status.cpu_percent:.0f}",
                f"{status.memory_percent:.0f} %",
                Text(said),
            )
            for each in status.lists:
                table.add_row(Text(f"  {describe_list(each)}", style="dim"))
                statuses = self._views[each.name, each.main_url, each.channel_prefix].statuses
                for process in each.processes:
                    table.add_row(*self._row(process, statuses.get((process.name, process.pid))))
        return table

    @staticmethod
    def _row(process: procman_process_t, stage: stage_status_t | None) -> tuple:
        from rich.text import Text

        runs = bool(process.pid)
        return (
            f"    {process.name}",
            Text(STATE_NAMES.get(process.state, "?"), style=STYLES.get(process.state, "")),
            str(process.num_starts),
            str(stage.queue) if stage else "",
            f"{stage.step_median_ms:.1f}" if stage else "",
            f"{process.cpu_percent:.0f}" if runs else "",
            f"{process.rss_mb:.0f}" if runs else "",
            Text(process.reason),
        )
