"""One process of a stack: started so that it can't outlive us, watched, stopped, and accounted by the kernel."""

import ctypes
import os
import re
import signal
import subprocess
import time
from pathlib import Path

from tessera_cli.errors import RunFailed, UserError

_PR_SET_PDEATHSIG = 1
_libc = ctypes.CDLL(None, use_errno=True)


def _die_with(parent: int) -> None:
    """Runs in the child before exec: the kernel kills it when `parent` is gone, however that went."""
    _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        os._exit(1)


class StageProcess:
    """May be started again after it died; usage adds up over its lives."""

    def __init__(self, name: str, command: list[str], log_path: Path):
        self.name = name
        self.command = command
        self.log_path = log_path
        self.pids: list[int] = []
        self.started_at = 0.0  # monotonic seconds
        self.cpu_s = 0.0
        self.max_rss_mb = 0.0
        self._popen: subprocess.Popen | None = None

    @property
    def pid(self) -> int | None:
        """None while it does not run."""
        return self._popen.pid if self._popen else None

    def start(self) -> None:
        parent = os.getpid()
        with open(self.log_path, "ab") as log:
            # A session of its own: Ctrl-C reaches us alone, and we end the stages in order.
            self._popen = subprocess.Popen(self.command, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                                           start_new_session=True, preexec_fn=lambda: _die_with(parent))
        self.pids.append(self._popen.pid)
        self.started_at = time.monotonic()

    def poll(self) -> int | None:
        """Exit status if it has just ended (negative: by that signal), else None."""
        if self._popen is None:
            return None
        self._note_peak_memory()
        pid, status, usage = os.wait4(self._popen.pid, os.WNOHANG)
        if pid == 0:
            return None
        self.cpu_s += usage.ru_utime + usage.ru_stime
        self._popen.returncode = os.waitstatus_to_exitcode(status)
        ended, self._popen = self._popen, None
        return ended.returncode

    def ask_to_end(self) -> None:
        self._signal(signal.SIGTERM)

    def kill(self) -> None:
        self._signal(signal.SIGKILL)

    def _note_peak_memory(self) -> None:
        """The kernel's high-water mark since exec. (ru_maxrss would begin with what this Python had when it forked.)"""
        try:
            status = Path(f"/proc/{self._popen.pid}/status").read_text()
        except OSError:
            return
        if peak := re.search(r"^VmHWM:\s*(\d+) kB", status, re.MULTILINE):
            self.max_rss_mb = max(self.max_rss_mb, 1024e-6 * int(peak[1]))

    def _signal(self, number: int) -> None:
        if self._popen is not None:
            self._note_peak_memory()
            os.kill(self._popen.pid, number)

    def last_words(self) -> str:
        """The last line of its log."""
        try:
            lines = [line for line in self.log_path.read_text(errors="replace").splitlines() if line.strip()]
        except OSError:
            lines = []
        # A stage names itself first; who quotes its words has named it already.
        return re.sub(r"^tessera-[a-z-]+: ", "", lines[-1].strip()) if lines else "(it said nothing)"

    def require_success(self, status: int) -> None:
        """Raises what its exit status and last words say if it did not end well."""
        if status == 2:
            raise UserError(f"{self.name}: {self.last_words()}")
        if status != 0:
            raise RunFailed(f"{self.name} {describe_exit(status)}: {self.last_words()}")


def describe_exit(status: int) -> str:
    if status >= 0:
        return f"ended with status {status}"
    try:
        return f"was killed by {signal.Signals(-status).name}"
    except ValueError:
        return f"was killed by signal {-status}"
