"""One running process of a deputy: started with its limits, its output read, accounted by the kernel, its whole tree ended."""

import ctypes
import os
import re
import signal
import subprocess
from dataclasses import dataclass
from pathlib import Path

from tessera_cli.supervision.attributes import RunOptions
from tessera_cli.supervision.process_tree import MARK, kill_marked, marked

_PR_SET_PDEATHSIG = 1
_libc = ctypes.CDLL(None, use_errno=True)
READ_BYTES = 65536


@dataclass(frozen=True)
class Launch:
    """What is executed; two equal ones need no new process."""

    words: tuple[str, ...]
    folder: Path
    environment: tuple[tuple[str, str], ...]
    command: str
    depends: tuple[str, ...]
    options: RunOptions
    run: str  # digest of the settings
    generation: int  # another one, another process


def describe_exit(status: int) -> str:
    """As `Child.poll` tells it."""
    if status >= 0:
        return f"ended with status {status}"
    try:
        return f"was killed by {signal.Signals(-status).name}"
    except ValueError:
        return f"was killed by signal {-status}"


def _prepare(parent: int, options: RunOptions) -> None:
    """Runs in the child before exec: the kernel kills it when `parent` is gone, however that went."""
    _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        os._exit(1)
    if options.nice:
        os.setpriority(os.PRIO_PROCESS, 0, os.getpriority(os.PRIO_PROCESS, 0) + options.nice)
    if options.cpus:
        os.sched_setaffinity(0, options.cpus)


class Child:
    def __init__(self, launch: Launch, mark: str) -> None:
        """Raises OSError or subprocess.SubprocessError (a nice value or CPU that the kernel refuses)."""
        parent = os.getpid()
        self._mark = mark
        self._popen = subprocess.Popen(
            launch.words,
            cwd=launch.folder,
            env={**os.environ, **dict(launch.environment), MARK: mark},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=lambda: _prepare(parent, launch.options),
        )
        os.set_blocking(self._popen.stdout.fileno(), False)
        self.pid = self._popen.pid
        self.may_say_more = True  # until it and all its descendants have closed their output
        self.cpu_s = 0.0  # of itself and of descendants that it waited for; known when it has ended
        self.max_rss_mb = 0.0  # its own peak, 10^6 bytes
        self._status: int | None = None

    def fileno(self) -> int:
        return self._popen.stdout.fileno()

    def read(self) -> bytes:
        """What it wrote since; empty if nothing."""
        try:
            data = os.read(self.fileno(), READ_BYTES)
        except BlockingIOError:
            return b""
        self.may_say_more = bool(data)
        return data

    def poll(self) -> int | None:
        """Exit status, negative: by that signal; None while it runs."""
        if self._status is None:
            self._note_peak_memory()
            self._reap(os.WNOHANG)
        return self._status

    def _reap(self, options: int) -> None:
        pid, status, usage = os.wait4(self.pid, options)
        if pid:
            self.cpu_s = usage.ru_utime + usage.ru_stime
            self._status = self._popen.returncode = os.waitstatus_to_exitcode(status)

    def _note_peak_memory(self) -> None:
        """The kernel's high-water mark since exec. (ru_maxrss would begin with what this Python had when it forked.)"""
        try:
            status = Path(f"/proc/{self.pid}/status").read_text()
        except OSError:
            return
        if peak := re.search(r"^VmHWM:\s*(\d+) kB", status, re.MULTILINE):
            self.max_rss_mb = max(self.max_rss_mb, 1024e-6 * int(peak[1]))

    def ask_to_end(self, number: int) -> None:
        """Its whole group, as a terminal would."""
        try:
            os.killpg(self.pid, number)
        except ProcessLookupError:
            pass

    def has_descendants(self) -> bool:
        return bool(marked(self._mark))

    def end(self) -> None:
        """Kills what is left of the tree."""
        if self._status is None:
            self._note_peak_memory()
        kill_marked(self._mark)
        if self._status is None:
            self._reap(0)

    def close(self) -> None:
        self._popen.stdout.close()
