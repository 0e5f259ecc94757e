"""Trees of processes: what they use, and how they are ended to the last descendant.

Every process that a deputy starts carries a mark in its environment, which its descendants inherit. So they are found
even when their parents are gone, whatever sessions and groups they have created.
"""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

from tessera_cli.constants import KILL_TIMEOUT_S

MARK = "TESSERA_PROCESS"  # its value: <deputy's folder>/<process>


def marked(value: str) -> list[int]:
    """Ids of processes with this mark; a value that ends in "/" stands for all that begin with it."""
    start = os.fsencode(f"\0{MARK}={value}") + (b"" if value.endswith("/") else b"\0")
    found = []
    for name in os.listdir("/proc"):
        if name.isdecimal() and int(name) != os.getpid():
            try:
                environment = b"\0" + Path(f"/proc/{name}/environ").read_bytes() + b"\0"
            except OSError:
                continue
            if start in environment:
                found.append(int(name))
    return found


def kill_marked(value: str) -> bool:
    """Kills until none is left, including those that are started meanwhile. False if some can't be killed."""
    deadline = time.monotonic() + KILL_TIMEOUT_S
    while pids := marked(value):
        for pid in pids:
            try:
                os.kill(pid, signal.SIGKILL)
            except OSError:
                pass
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


@dataclass
class Usage:
    """Of a process and all its descendants."""

    pids: frozenset[int] = frozenset()
    cpu_percent: float = 0.0  # since the last snapshot; 100 is one core
    total_cpu_s: float = 0.0  # of these processes since their starts
    rss_mb: float = 0.0  # 10^6 bytes


class ProcessTrees:
    """Measures process trees; reads all processes of the machine once per snapshot."""

    def __init__(self) -> None:
        self._cpu_s: dict[int, float] = {}
        self._taken_at = 0.0

    def snapshot(self, roots: list[int], now: float) -> dict[int, Usage]:
        """The usage of each tree by its root. `now`: monotonic seconds."""
        import psutil  # late: the guard does without it, and a run starts its processes first

        children: dict[int, list[int]] = {}
        for process in psutil.process_iter(["ppid"]):
            children.setdefault(process.info["ppid"], []).append(process.pid)
        elapsed_s = now - self._taken_at
        before, self._cpu_s, self._taken_at = self._cpu_s, {}, now
        return {root: self._usage(root, children, before, elapsed_s) for root in roots}

    def _usage(self, root: int, children: dict[int, list[int]], before: dict[int, float], elapsed_s: float) -> Usage:
        import psutil

        pids, rss_bytes, cpu_s, total_cpu_s = [root], 0, 0.0, 0.0
        for pid in pids:  # grows while it is walked
            pids += children.get(pid, [])
            try:
                process = psutil.Process(pid)
                times = process.cpu_times()
                rss_bytes += process.memory_info().rss
            except psutil.Error:
                continue
            self._cpu_s[pid] = times.user + times.system
            cpu_s += self._cpu_s[pid] - before.get(pid, self._cpu_s[pid])
            total_cpu_s += self._cpu_s[pid]
        return Usage(frozenset(pids), 100 * cpu_s / elapsed_s if elapsed_s > 0 else 0.0, total_cpu_s, rss_bytes / 1e6)
