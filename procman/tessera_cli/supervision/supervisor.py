"""All processes of one deputy, and the states of those on other deputies that they wait for."""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace

from tessera_cli.constants import LONGEST_TURN_S, REMOTE_STATE_TIMEOUT_S, USAGE_PERIOD_S
from tessera_cli.messages import procman_process_t
from tessera_cli.supervision.child_process import ChildProcess, Launch
from tessera_cli.supervision.log_file import ProcessLog
from tessera_cli.supervision.process_tree import ProcessTrees
from tessera_cli.supervision.state_folder import LogFolder
from tessera_cli.supervision.supervised_process import READY, STATE_NAMES, SupervisedProcess


class Supervisor:
    """`step` is called regularly by the deputy. All times are monotonic seconds."""

    def __init__(self, folder: LogFolder, on_output: Callable[[str, bytes], None]) -> None:
        self._folder, self._on_output = folder, on_output
        self._processes: dict[str, SupervisedProcess] = {}
        self._remote: dict[str, tuple[int, float]] = {}  # (state, when received)
        self._trees = ProcessTrees()
        self._usage_at = 0.0
        self._stepped_at: float | None = None
        self._reported: dict[str, str] = {}

    @property
    def names(self) -> list[str]:
        return list(self._processes)

    @property
    def processes(self) -> list[SupervisedProcess]:
        return list(self._processes.values())

    @property
    def readable_children(self) -> list[ChildProcess]:
        """Those whose output is worth waiting for."""
        children = [process.child for process in self._processes.values()]
        return [child for child in children if child and child.has_open_output]

    @property
    def is_idle(self) -> bool:
        return all(process.is_idle for process in self._processes.values())

    @property
    def snapshot(self) -> tuple[tuple[str, int, str, int], ...]:
        """What other nodes should know at once when it changes."""
        return tuple(
            (process.name, process.state, process.reason, process.num_starts) for process in self._processes.values()
        )

    def state_changes(self) -> list[str]:
        """A sentence for each process whose state has changed since the last call."""
        now = {
            process.name: f"{process.name} is {STATE_NAMES[process.state]}"
            + (f": {process.reason}" if process.reason else "")
            for process in self._processes.values()
        }
        changed = [sentence for name, sentence in now.items() if self._reported.get(name) != sentence]
        self._reported = now
        return changed

    def generations(self, run: str) -> dict[str, int]:
        """Of the processes that are wanted with the settings of this run."""
        return {
            name: process.wanted.generation
            for name, process in self._processes.items()
            if process.wanted and process.wanted.run == run
        }

    def set_wanted(self, launches: Mapping[str, Launch], session: str, prefix: str = "") -> None:
        """Of the processes whose names begin with `prefix`, exactly these are to run.

        Those that ended before and are not wanted are forgotten.
        """
        for name in [name for name in self._processes if name.startswith(prefix) and name not in launches]:
            if self._processes[name].is_idle:
                self._processes.pop(name).log.close()
        for name in [name for name in launches if name not in self._processes]:
            log = ProcessLog(self._folder.log_path(name))
            self._processes[name] = SupervisedProcess(name, self._folder.mark(name), log, self._on_output)
        for name, process in self._processes.items():
            if name.startswith(prefix):
                process.set_wanted(launches.get(name), session)

    def restart(self, name: str, generation: int) -> None:
        process = self._processes[name]
        if process.wanted:
            process.set_wanted(replace(process.wanted, generation=generation), process.session)

    def log_tail(self, name: str, num_lines: int) -> str:
        return self._processes[name].log.tail(num_lines)

    def on_stage_status(self, name: str, pid: int, is_finished: bool, received_at: float) -> None:
        """The status of any stage; ignored if it is none of ours."""
        process = self._processes.get(name)
        if process and process.child and pid in {process.child.pid, *process.usage.pids}:
            process.on_stage_status(is_finished, received_at)

    def set_remote_states(self, states: Mapping[str, int], now: float) -> None:
        """States of another deputy's processes by name."""
        for name, state in states.items():
            if name not in self._processes:
                self._remote[name] = (state, now)

    def forget_remote_states(self, prefix: str) -> None:
        """Of processes whose names begin with `prefix`."""
        self._remote = {name: heard for name, heard in self._remote.items() if not name.startswith(prefix)}

    def step(self, now: float) -> None:
        """Looks once at every process and does what is due."""
        if self._stepped_at is not None and now - self._stepped_at > LONGEST_TURN_S:
            for process in self._processes.values():
                process.extend_time_outs(now - self._stepped_at, now)
        self._stepped_at = now
        if now - self._usage_at >= USAGE_PERIOD_S:
            self._usage_at = now
            self._measure(now)
        # A process that has finished its work, or not begun it, doesn't need the others.
        idle = (procman_process_t.FINISHED, procman_process_t.WAITING)
        working = [p for p in self._processes.values() if p.child and p.state not in idle]
        needed = {name for process in working for name in process.depends}
        for process in self._processes.values():
            process.step(now, self._is_not_ready, process.name in needed)

    def _measure(self, now: float) -> None:
        roots = [process.child.pid for process in self._processes.values() if process.child]
        usages = self._trees.snapshot(roots, now) if roots else {}
        for process in self._processes.values():
            if process.child and process.child.pid in usages:
                process.usage = usages[process.child.pid]

    def _is_not_ready(self, name: str) -> bool:
        if process := self._processes.get(name):
            return process.state not in READY
        state, received_at = self._remote.get(name, (procman_process_t.STOPPED, 0.0))
        return state not in READY or time.monotonic() - received_at > REMOTE_STATE_TIMEOUT_S
