"""The deputy of one command such as `tessera run`, whose processes take no orders and end with the command in any case.

It has the supervisor, process lists and guard of a node's deputy (deputy.py), but no bus, keys or orders.
"""

import re
import time
from collections.abc import Iterable, Mapping
from pathlib import Path

from tessera_cli.constants import STOP_POLL_S
from tessera_cli.errors import RunError, UserError
from tessera_cli.files import BIN
from tessera_cli.messages import procman_process_t as states
from tessera_cli.supervision.attributes import RunOptions
from tessera_cli.supervision.command_list import SHIPPED_LIST, LocalCommand, read_command_list
from tessera_cli.supervision.guard import Guard
from tessera_cli.supervision.process_list import Process
from tessera_cli.supervision.progress import FINISHED, RUNNING, StageReport
from tessera_cli.supervision.state_folder import LogFolder
from tessera_cli.supervision.supervised_process import READY, SupervisedProcess
from tessera_cli.supervision.supervisor import Supervisor
from tessera_cli.supervision.wishes import to_launch, to_wish

# Of one core; stages that wait need one or two percent.
BUSY_PERCENT = 10.0
# A stage begins its sentences with its own name, which the quoting sentence has already given.
OWN_NAME = re.compile(r"^tessera-[a-z-]+: ")


def single_process(name: str, command: str, stop_time_allowed: float) -> Process:
    """A process that ends by itself when its work is done."""
    options = RunOptions(ready="started", auto_respawn="never", stop_time_allowed=stop_time_allowed)
    return Process(name, command, "", 0, (), options)


class PrivateDeputy:
    """`step` must be called regularly."""

    def __init__(
        self,
        folder: LogFolder,
        settings_path: Path,
        processes: Iterable[Process],
        commands: Mapping[str, LocalCommand] | None = None,
    ) -> None:
        """`commands`: what their names stand for; by default the shipped list, in the caller's working folder."""
        commands = commands or read_command_list(SHIPPED_LIST, Path.cwd())
        values = {"bin": str(BIN), "settings": str(settings_path)}
        self._wanted = {process.name: to_launch(to_wish(process), commands, values, "", 0) for process in processes}
        self._commands = {name: launch.command for name, launch in self._wanted.items()}
        self._guard = Guard(folder.mark())
        self._supervisor = Supervisor(folder, lambda _name, _output: None)
        self._processes: dict[str, SupervisedProcess] = {}  # also those that the supervisor has forgotten
        self._pids: set[int] = set()  # of all processes that ever ran
        self._num_failures_seen: dict[str, int] = {}
        self.warnings: list[str] = []

    def start(self) -> None:
        self._supervisor.set_wanted(self._wanted, "")
        self._processes = {process.name: process for process in self._supervisor.processes}
        self.step()

    @property
    def processes(self) -> list[SupervisedProcess]:
        return list(self._processes.values())

    @property
    def not_ready(self) -> list[str]:
        return [process.name for process in self.processes if process.state not in READY]

    @property
    def ended(self) -> list[str]:
        """Those that ended by themselves with status 0."""
        return [process.name for process in self.processes if process.state == states.ENDED]

    @property
    def is_over(self) -> bool:
        """Nothing runs, and nothing will be restarted."""
        return all(
            process.child is None and process.state in (states.ENDED, states.STOPPED) for process in self.processes
        )

    def is_busy(self, names: Iterable[str]) -> bool:
        """Whether one of them uses processor time: a stage publishes nothing during a long step."""
        chosen = [process for process in self.processes if process.name in names]
        return any(process.child and process.usage.cpu_percent > BUSY_PERCENT for process in chosen)

    def owns(self, pid: int) -> bool:
        return pid in self._pids

    def num_restarts(self, command: str) -> int:
        """Of all processes of this command of the list."""
        chosen = [process for process in self.processes if self._commands[process.name] == command]
        return sum(max(0, process.num_starts - 1) for process in chosen)

    def on_stage_reports(self, reports: Iterable[StageReport]) -> None:
        """The last STATUS of stages; the same ones may be given again."""
        for report in reports:
            if report.state in (RUNNING, FINISHED):
                self._supervisor.on_stage_status(report.name, report.pid, report.state == FINISHED, report.received_at)

    def step(self) -> None:
        """Looks once at every process. Raises UserError or RunError when one has failed for good."""
        self._guard.watch()
        self._turn()
        for process in self.processes:
            is_new = process.num_failures > self._num_failures_seen.get(process.name, 0)
            if is_new and process.state == states.BACKING_OFF and process.last_exit:
                self.warnings.append(f"{process.name} {process.last_exit.description} and was restarted.")
            self._num_failures_seen[process.name] = process.num_failures
            if process.state == states.FAILED:
                raise _failure(process)

    def _turn(self) -> None:
        self._supervisor.step(time.monotonic())
        self._pids.update(process.child.pid for process in self.processes if process.child)

    def request_stop(self, names: Iterable[str]) -> None:
        """They end while the others continue, but not before those that depend on them have finished their work."""
        for name in names:
            self._wanted.pop(name, None)
        self._supervisor.set_wanted(self._wanted, "")

    def stop(self, names: Iterable[str] | None = None) -> None:
        """Returns when these (None: all) and those that depend on them have ended; after a time-out they are killed."""
        running = [process for process in self.processes if not process.is_idle]
        chosen = {process.name for process in running if names is None or process.name in names}
        chosen |= {
            process.name
            for process in self.processes
            if process.state != states.FINISHED and chosen & set(process.depends)
        }
        self.request_stop(chosen)
        while not all(self._processes[name].is_idle for name in chosen):
            self._turn()
            time.sleep(STOP_POLL_S)
        reasons = {name: self._processes[name].reason for name in sorted(chosen)}
        self.warnings += [f"{name} {reason}." for name, reason in reasons.items() if reason]

    def require_success(self, name: str) -> None:
        """Raises UserError or RunError with the last line of its output if it did not end with status 0."""
        process = self._processes[name]
        if process.last_exit and process.last_exit.status != 0:
            raise _failure(process)

    def last_line(self, name: str) -> str:
        """Of the output of a process."""
        return OWN_NAME.sub("", self._processes[name].last_line)

    def kill(self) -> None:
        """All processes at once."""
        self.request_stop(list(self._wanted))
        for process in self.processes:
            process.kill()
        self._turn()
        self._guard.end()


def _failure(process: SupervisedProcess) -> UserError | RunError:
    last_exit, last_line = process.last_exit, OWN_NAME.sub("", process.last_line)
    if last_exit is None:
        return RunError(f"{process.name} {process.reason}.")
    if last_exit.status == 2:
        return UserError(f"{process.name}: {last_line}")
    return RunError(f"{process.name} {last_exit.description}; the last line of {process.log.path}: {last_line}")
