"""Notices stages that say nothing for seconds though they don't work: stopped by a signal, or without a processor."""

from collections.abc import Callable, Iterable
from pathlib import Path

from tessera_cli.constants import SILENT_STAGE_S
from tessera_cli.supervision.progress import RUNNING, StageReport


def is_stopped(pid: int) -> bool:
    """By SIGSTOP, a debugger or Ctrl-Z."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in ("T", "t")
    except (OSError, IndexError):
        return False


class SilenceWatch:
    """`step` is called regularly. All times are monotonic seconds."""

    def __init__(self, is_busy: Callable[[str], bool]) -> None:
        """`is_busy`: whether the stage of this name uses the processor: it says nothing during a long step."""
        self._is_busy = is_busy
        self._silent_since: dict[str, float] = {}  # of those that were told
        self._busy_at: dict[str, float] = {}
        self.warnings: list[str] = []  # for the summary, one for each silence that has ended

    def step(self, reports: Iterable[StageReport], now: float) -> list[str]:
        """Sentences about stages that have fallen silent, and about those that are back. `reports`: the last ones."""
        sentences = []
        for report in reports:
            name, since = report.name, self._silent_since.get(report.name)
            if since is not None and report.received_at > since:
                del self._silent_since[name]
                duration_s = report.received_at - since
                self.warnings.append(f"{name} said nothing for {duration_s:.1f} s.")
                sentences.append(f"{name} is back after {duration_s:.1f} s")
            elif since is None and report.state == RUNNING and self._is_silent(report, now):
                self._silent_since[name] = report.received_at
                why = "is stopped (SIGCONT lets it go on)" if is_stopped(report.pid) else "does not work either"
                sentences.append(f"{name} has said nothing for {now - report.received_at:.0f} s and {why}")
        return sentences

    def _is_silent(self, report: StageReport, now: float) -> bool:
        if self._is_busy(report.name) and not is_stopped(report.pid):
            self._busy_at[report.name] = now
        return now - max(report.received_at, self._busy_at.get(report.name, 0.0)) > SILENT_STAGE_S
