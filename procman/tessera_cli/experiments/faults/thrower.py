"""Throws faults into one run while it runs, and keeps when each was thrown and when poses came."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from tessera_cli.constants import POSE
from tessera_cli.experiments.distribution.cpu_groups import CpuGroups
from tessera_cli.experiments.faults import network
from tessera_cli.experiments.faults.schedule import KILL, LOSS, SLOW, STOP, Fault
from tessera_cli.lcm_bus import Bus, listen
from tessera_cli.messages import pose_t
from tessera_cli.runs.run_folder import keeps_journal
from tessera_cli.supervision.process_tree import marked
from tessera_cli.supervision.progress import is_tracker_pose

# Of a core, for a slow node.
SLOW_SHARE = 0.1
LISTEN_S = 0.01
# A process that has not been there for so long has ended: its fault is left out.
MISSING_S = 10.0
# What one that keeps a journal says (stage_engine.cc) when it has continued by it.
IS_BACK = "continues where it was when it was killed"
# Poses of so many frames may follow a death that none of them needed: dispatcher.max_frames_in_flight, and some more.
IN_FLIGHT = 10


@dataclass
class Thrown:
    """A fault that was thrown. Times are monotonic seconds."""

    process: str
    kind: str
    frame: int  # of the last pose before it
    began_s: float
    ended_s: float  # of a process that was killed: when it was back where it had been


class Thrower:
    """`look` is called several times a second. When the context is left, nothing is stopped, slow or lost any more."""

    def __init__(
        self, folder: Path, url: str, faults: Iterator[Fault], most: int, until_s: float, groups: CpuGroups | None
    ) -> None:
        """`folder`: of the run; `url`: of its main bus; `groups`: one, for what is slow.

        At most so many faults are thrown, and none after `until_s` (monotonic).
        """
        self._folder, self._faults, self._most, self._until_s = folder, faults, most, until_s
        self._groups = groups
        self._bus = Bus(url, "fault_thrower")
        self._bus.subscribe(POSE, pose_t, self._on_pose)
        self._next: Fault | None = None
        self._due_s: float | None = None
        self._undo_at: float | None = None
        self._undo: Callable[[], None] = _nothing
        self._is_journaled = False  # the process that was killed last
        self._num_back = 0  # times that it had come back before
        self._last_frame = -1
        self.pose_times: list[float] = []  # monotonic seconds, of frames that had none before
        self.thrown: list[Thrown] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _type: type[BaseException] | None, _error: object, _trace: TracebackType | None) -> None:
        self._end(time.monotonic())

    def look(self) -> None:
        listen([self._bus], LISTEN_S)
        now = time.monotonic()
        if self._undo_at is not None:
            if now >= self._undo_at and self._is_back():
                self._end(now)
        elif len(self.thrown) < self._most and now < self._until_s and self._is_due(now):
            self._throw(now)

    def _on_pose(self, pose: pose_t) -> None:
        """A tracker that was started again may repeat poses."""
        if is_tracker_pose(pose) and pose.frame > self._last_frame:
            self._last_frame = pose.frame
            self.pose_times.append(time.monotonic())

    def _is_due(self, now: float) -> bool:
        """The next fault waits for a pose after the end of the one before: pauses belong to one fault each."""
        if self._next is None:
            self._next, self._due_s = next(self._faults), None
        if self._due_s is None:
            since = self.thrown[-1].ended_s if self.thrown else 0.0
            if self.pose_times and self.pose_times[-1] > since:
                self._due_s = self.pose_times[-1] + self._next.wait_s
        return self._due_s is not None and now >= self._due_s

    def _throw(self, now: float) -> None:
        fault = self._next
        assert fault and self._due_s is not None
        pids = marked(f"{self._folder}/stages/{fault.process}")
        if not pids and fault.kind != LOSS:  # it is about to be restarted
            if now - self._due_s > MISSING_S:
                self._next = None
            return
        self._undo = self._make(fault, pids)
        self._undo_at = now + fault.duration_s
        self.thrown.append(Thrown(fault.process, fault.kind, self._last_frame, now, now))
        self._next = None

    def _is_back(self) -> bool:
        """What was killed repeats its steps, or reads its source again: the pauses of that time are of this fault."""
        fault = self.thrown[-1]
        if fault.kind != KILL:
            return True
        if self._is_journaled:
            return self._count_back(fault.process) > self._num_back
        return self._last_frame >= fault.frame + IN_FLIGHT

    def _count_back(self, process: str) -> int:
        log = self._folder / "stages" / f"{process}.log"
        return log.read_text(errors="replace").count(IS_BACK) if log.is_file() else 0

    def _make(self, fault: Fault, pids: list[int]) -> Callable[[], None]:
        """Returns what ends the fault."""
        if fault.kind == LOSS:
            network.lose(network.LOSS_PERCENT)
            return lambda: network.lose(0)
        if fault.kind == SLOW:
            groups = self._groups
            assert groups
            groups.set_share(SLOW_SHARE)
            for pid in pids:
                groups.join(0, pid)
            return lambda: groups.set_share(1.0)
        self._is_journaled = keeps_journal(self._folder, fault.process)
        self._num_back = self._count_back(fault.process)
        _send(pids, {KILL: signal.SIGKILL, STOP: signal.SIGSTOP}[fault.kind])
        return (lambda: _send(pids, signal.SIGCONT)) if fault.kind == STOP else _nothing

    def _end(self, now: float) -> None:
        if self._undo_at is not None:
            self._undo()
            self.thrown[-1].ended_s = now
        self._undo, self._undo_at = _nothing, None


def _nothing() -> None:
    pass


def _send(pids: list[int], number: signal.Signals) -> None:
    for pid in pids:
        try:
            os.kill(pid, number)
        except ProcessLookupError:
            pass  # it has just ended
