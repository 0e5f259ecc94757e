"""One running process of a deputy: its start with limits, its output, its usage, and its end with all descendants."""

import ctypes
import os
import re
import signal
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from tessera_cli.supervision.attributes import RunOptions
from tessera_cli.supervision.process_tree import MARK, kill_marked, marked

_PR_SET_PDEATHSIG = 1
_libc = ctypes.CDLL(None, use_errno=True)
READ_BYTES = 65536


@dataclass(frozen=True)
class Launch:
    """What is executed. A process is restarted when it is wanted with another Launch than it runs with."""

    words: tuple[str, ...]  # program and arguments
    held: str  # the argument that makes it wait until its input ends; empty: it can't be held
    folder: Path
    environment: tuple[tuple[str, str], ...]
    command: str
    depends: tuple[str, ...]
    options: RunOptions
    run: str  # digest of the settings
    generation: int  # counts ordered restarts


def describe_exit(status: int) -> str:
    """`status` as returned by ChildProcess.poll; the words continue a sentence that begins with the process's name."""
    if status >= 0:
        return f"ended with status {status}"
    try:
        return f"was killed by {signal.Signals(-status).name}"
    except ValueError:
        return f"was killed by signal {-status}"


def _prepare(parent: int, options: RunOptions) -> None:
    """Runs in the child before exec. The kernel kills the child as soon as `parent` has died, for whatever reason."""
    _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        os._exit(1)
    if options.nice:
        os.setpriority(os.PRIO_PROCESS, 0, os.getpriority(os.PRIO_PROCESS, 0) + options.nice)
    if options.cpus:
        os.sched_setaffinity(0, options.cpus)


class ChildProcess:
    """A process, from its start to the end of the last of its descendants."""

    def __init__(self, launch: Launch, mark: str, is_held: bool = False) -> None:
        """`is_held`: it prepares itself, and works from `release` on.

        Raises OSError or subprocess.SubprocessError (a nice value or CPU that the kernel refuses).
        """
        parent = os.getpid()
        self._mark = mark
        self._popen = subprocess.Popen(
            [*launch.words, *([launch.held] if is_held else [])],
            cwd=launch.folder,
            env={**os.environ, **dict(launch.environment), MARK: mark},
            stdin=subprocess.PIPE if is_held else subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=lambda: _prepare(parent, launch.options),
        )
        assert self._popen.stdout is not None
        self._output: IO[bytes] = self._popen.stdout
        os.set_blocking(self._output.fileno(), False)
        self.pid = self._popen.pid
        self.has_open_output = True  # until it and all its descendants have closed it
        self.cpu_s = 0.0  # of itself and of descendants that it waited for; known when it has ended
        self.max_rss_mb = 0.0  # its own peak, 10^6 bytes
        self._status: int | None = None

    @property
    def is_held(self) -> bool:
        return self._popen.stdin is not None and not self._popen.stdin.closed

    def release(self) -> None:
        if self._popen.stdin is not None:
            self._popen.stdin.close()

    def fileno(self) -> int:
        return self._output.fileno()

    def read(self) -> bytes:
        """What it has written since the last call; empty if nothing."""
        try:
            data = os.read(self.fileno(), READ_BYTES)
        except BlockingIOError:
            return b""
        self.has_open_output = bool(data)
        return data

    def poll(self) -> int | None:
        """Exit status, negative: by that signal; None while it runs."""
        if self._status is None:
            self._note_peak_memory()
            self._wait(os.WNOHANG)
        return self._status

    def _wait(self, options: int) -> None:
        pid, status, usage = os.wait4(self.pid, options)
        if pid:
            self.cpu_s = usage.ru_utime + usage.ru_stime
            self._status = self._popen.returncode = os.waitstatus_to_exitcode(status)

    def _note_peak_memory(self) -> None:
        """The kernel's high-water mark since exec. (ru_maxrss starts with what this Python had when it forked.)"""
        try:
            status = Path(f"/proc/{self.pid}/status").read_text()
        except OSError:
            return
        if peak := re.search(r"^VmHWM:\s*(\d+) kB", status, re.MULTILINE):
            self.max_rss_mb = max(self.max_rss_mb, 1024e-6 * int(peak[1]))

    def signal_group(self, number: int) -> None:
        """To its whole process group, as a terminal does."""
        try:
            os.killpg(self.pid, number)
        except ProcessLookupError:
            pass

    def has_descendants(self) -> bool:
        return bool(marked(self._mark))

    def kill(self) -> None:
        """Kills what is left of it and its descendants."""
        if self._status is None:
            self._note_peak_memory()
        kill_marked(self._mark)
        if self._status is None:
            self._wait(0)

    def close(self) -> None:
        self.release()
        self._output.close()
