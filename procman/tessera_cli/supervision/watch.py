"""tessera watch: nodes, processes, the frame rate of each list and the output of processes, redrawn until Ctrl-C."""

import re
import sys
import time
from argparse import Namespace
from collections import deque

from rich import box
from rich.console import Group
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from tessera_cli.constants import LINE_PERIOD_S, LISTEN_S, WATCH_PANEL_PERIOD_S
from tessera_cli.interrupt import Interrupt
from tessera_cli.messages import procman_output_t, procman_process_t
from tessera_cli.supervision.list_monitor import ListMonitor
from tessera_cli.supervision.progress import StageReport
from tessera_cli.supervision.sheriff import KnownDeputy, Sheriff
from tessera_cli.supervision.sheriff_commands import describe_list, print_status
from tessera_cli.supervision.supervised_process import STATE_NAMES

NUM_LINES = 6
# What deputies say is not signed: LCM would also write a file:// URL, and takes a channel for a regular expression.
BUS, PREFIX = re.compile(r"udpm://[0-9.]+:[0-9]+(\?[a-z_0-9=&]*)?"), re.compile(r"[A-Za-z0-9_/-]{0,32}")
STYLES = {
    procman_process_t.READY: "green",
    procman_process_t.FINISHED: "green",
    procman_process_t.FAILED: "bold red",
    procman_process_t.BACKING_OFF: "yellow",
    procman_process_t.WAITING: "yellow",
    procman_process_t.STARTING: "yellow",
}


def watch(arguments: Namespace) -> int:
    """Until Ctrl-C: a panel in a terminal, lines for logs and pipes."""
    watcher, interrupt = Watcher(arguments), Interrupt()
    if sys.stdout.isatty():
        watcher.draw_until(interrupt)
    else:
        watcher.print_until(interrupt)
    return 0


class Watcher:
    """Listens to all deputies and to the stages of all their lists."""

    def __init__(self, arguments: Namespace) -> None:
        self._sheriff = Sheriff(arguments)
        self._sheriff.on_output(self._on_output)
        self._monitors: dict[tuple[str, str, str], ListMonitor] = {}  # by list, bus and prefix
        self._lines: deque[str] = deque(maxlen=NUM_LINES)

    def _on_output(self, output: procman_output_t) -> None:
        if not output.order:
            self._lines.extend(f"{output.process}: {line}" for line in output.text.splitlines())

    def _follow_lists(self) -> None:
        """Listens to new lists, and no longer to those that are gone."""
        wanted = {
            (each.name, each.main_url, each.channel_prefix)
            for deputy in self._sheriff.deputies.values()
            for each in deputy.status.lists
            if BUS.fullmatch(each.main_url) and PREFIX.fullmatch(each.channel_prefix)
        }
        self._monitors = {key: self._monitors.get(key) or ListMonitor(*key[1:]) for key in sorted(wanted)}
        self._sheriff.also_listen_to([monitor.bus for monitor in self._monitors.values()])

    def _listen(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        while (left_s := until - time.monotonic()) > 0:
            self._sheriff.listen(min(left_s, LISTEN_S))
            self._follow_lists()

    def print_until(self, interrupt: Interrupt) -> None:
        while not interrupt.requested:
            self._listen(LINE_PERIOD_S)
            print("\n".join(self._progress_lines()))
            print_status(self._sheriff)
            sys.stdout.flush()

    def draw_until(self, interrupt: Interrupt) -> None:
        with Live(auto_refresh=False, screen=True) as live:
            while not interrupt.requested:
                self._listen(WATCH_PANEL_PERIOD_S)
                live.update(self._draw(), refresh=True)

    def _progress_lines(self) -> list[str]:
        """One for each list whose tracker publishes poses."""
        if not self._sheriff.deputies:
            return ["no deputy answers: `tessera deputy` starts one; `tessera run` has a panel of its own"]
        lines = [f"{name}: {words}" for (name, _, _), each in self._monitors.items() if (words := each.describe())]
        return lines or ["no pose yet"]

    def _draw(self) -> Panel:
        lines = Text("\n".join(self._lines) or "no output yet", style="dim", overflow="ellipsis", no_wrap=True)
        content = Group(Text("\n".join(self._progress_lines())), self._draw_table(), lines)
        return Panel(content, title="tessera watch", box=box.ROUNDED)

    def _draw_table(self) -> Table:
        table = Table(box=box.SIMPLE_HEAD, expand=True, padding=(0, 1), pad_edge=False)
        for heading in ("process", "state"):
            table.add_column(heading, no_wrap=True)
        for heading in ("starts", "queue", "step ms", "CPU %", "MB"):
            table.add_column(heading, justify="right", no_wrap=True)
        table.add_column("reason", no_wrap=True, overflow="ellipsis", ratio=1)
        for name, deputy in sorted(self._sheriff.deputies.items()):
            table.add_row(*_deputy_row(name, deputy))
            for each in deputy.status.lists:
                table.add_row(Text(f"  {describe_list(each)}", style="dim"))
                monitor = self._monitors.get((each.name, each.main_url, each.channel_prefix))
                for process in each.processes:
                    report = monitor.reports.get((process.name, process.pid)) if monitor else None
                    table.add_row(*_process_row(process, report))
        return table


def _deputy_row(name: str, deputy: KnownDeputy) -> tuple[str | Text, ...]:
    status, num_refused = deputy.status, sum(deputy.status.num_refused)
    reason = "no longer answers" if deputy.is_silent else f"{num_refused} orders refused" if num_refused else ""
    return (
        Text(name, style="bold"),
        Text("silent" if deputy.is_silent else "", style="bold red"),
        *("", "", ""),
        f"{status.cpu_percent:.0f}",
        f"{status.memory_percent:.0f} %",
        Text(reason),
    )


def _process_row(process: procman_process_t, report: StageReport | None) -> tuple[str | Text, ...]:
    return (
        Text(f"    {process.name}"),
        Text(STATE_NAMES.get(process.state, "?"), style=STYLES.get(process.state, "")),
        str(process.num_starts),
        str(report.queue) if report else "",
        f"{report.step_ms:.1f}" if report else "",
        f"{process.cpu_percent:.0f}" if process.pid else "",
        f"{process.rss_mb:.0f}" if process.pid else "",
        Text(process.reason),
    )
