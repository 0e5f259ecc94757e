"""tessera watch: nodes and processes, how fast poses come, and what processes say, drawn anew twice a second until Ctrl-C."""

import sys
import time
from argparse import Namespace
from collections import deque

from tessera_cli.interrupt import Interrupt
from tessera_cli.lan.commands import print_status
from tessera_cli.lan.procman_bus import Bus, ttl_of
from tessera_cli.lan.sheriff import Sheriff
from tessera_cli.lan.supervised import STATE_NAMES
from tessera_cli.panel import describe_time
from tessera_cli.progress import Progress
from tessera_cli.settings import bus_url
from tessera_cli.types import pose_t, procman_output_t, procman_process_t, stage_status_t

PANEL_PERIOD_S = 0.5
LINES_PERIOD_S = 5.0
NUM_LINES = 6
TRACKING_STATES = {pose_t.INITIALIZING: "initializing", pose_t.TRACKED: "tracked", pose_t.LOST: "lost"}
STYLES = {procman_process_t.READY: "green", procman_process_t.FINISHED: "green", procman_process_t.FAILED: "bold red",
          procman_process_t.BACKING_OFF: "yellow", procman_process_t.WAITING: "yellow", procman_process_t.STARTING: "yellow"}


def main(arguments: Namespace) -> int:
    watcher = Watcher(arguments)
    interrupt = Interrupt()
    return watcher.draw_until(interrupt) if sys.stdout.isatty() else watcher.print_until(interrupt)


class Watcher:
    def __init__(self, arguments: Namespace):
        self._sheriff = Sheriff(arguments)
        self._sheriff.on_output(self._on_output)
        self._stages = Bus(bus_url(arguments.port).replace("?ttl=0", f"?ttl={ttl_of(arguments)}"), "watch")
        self._stages.subscribe(arguments.prefix + "STATUS", stage_status_t, self._on_stage)
        self._stages.subscribe(arguments.prefix + "POSE", pose_t, self._on_pose)
        self._progress = Progress()
        self._statuses: dict[str, stage_status_t] = {}
        self._lines: deque[str] = deque(maxlen=NUM_LINES)

    def _on_output(self, output: procman_output_t) -> None:
        if not output.order:
            self._lines.extend(f"{output.process}: {line}" for line in output.text.splitlines())

    def _on_stage(self, status: stage_status_t) -> None:
        self._statuses[status.name] = status
        values = dict(zip(status.value_names, status.values))
        if status.name == "camera" and values.get("num_frames", 0) > 0:
            self._progress.num_frames = int(values["num_frames"])

    def _on_pose(self, pose: pose_t) -> None:
        if pose.header.publisher == "tracker" and pose.state in TRACKING_STATES:
            if pose.frame <= self._progress.last_frame:  # another run has begun
                self._progress = Progress(num_frames=self._progress.num_frames)
            self._progress.add_pose(pose.frame, TRACKING_STATES[pose.state])

    def _listen(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        while (left_s := until - time.monotonic()) > 0:
            self._sheriff.listen(min(left_s, 0.05))
            self._stages.handle_waiting()

    def print_until(self, interrupt: Interrupt) -> int:
        """For logs and pipes."""
        while not interrupt.requested:
            self._listen(LINES_PERIOD_S)
            print(self._progress_line())
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

    def _progress_line(self) -> str:
        progress = self._progress
        if progress.num_poses == 0:
            return "no pose yet"
        of_all = f" of {progress.num_frames}" if progress.num_frames else ""
        return (f"frame {progress.last_frame + 1}{of_all}, {progress.frames_per_s:.1f}/s, {describe_time(progress.time_left_s)} left, "
                f"{progress.tracking_state}")

    def _draw(self):
        from rich import box
        from rich.console import Group
        from rich.panel import Panel
        from rich.text import Text

        lines = Text("\n".join(self._lines) or "no output yet", style="dim", overflow="ellipsis", no_wrap=True)
        return Panel(Group(Text(self._progress_line()), self._draw_table(), lines), title="tessera watch", box=box.ROUNDED)

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
            table.add_row(Text(deputy, style="bold"), Text("silent" if heard.is_silent else "", style="bold red"), "", "", "",
                          f"{status.cpu_percent:.0f}", f"{status.memory_percent:.0f} %", Text(said))
            for process in status.processes:
                table.add_row(*self._row(process))
        return table

    def _row(self, process: procman_process_t) -> tuple:
        from rich.text import Text

        stage = self._statuses.get(process.name) if process.pid else None
        runs = bool(process.pid)
        return (f"  {process.name}", Text(STATE_NAMES.get(process.state, "?"), style=STYLES.get(process.state, "")), str(process.num_starts),
                str(stage.queue) if stage else "", f"{stage.step_median_ms:.1f}" if stage else "",
                f"{process.cpu_percent:.0f}" if runs else "", f"{process.rss_mb:.0f}" if runs else "", Text(process.reason))
