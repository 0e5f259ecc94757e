"""The deputy of one command such as `tessera run`: its processes take orders from nobody else, and end with it, however
that goes.

It has the crew, the lists and the guard of a node's deputy (deputy.py), and no bus, keys and orders.
"""

import re
import time
from collections.abc import Iterable
from pathlib import Path

from tessera_cli.errors import RunFailed, UserError
from tessera_cli.files import BIN, ROOT
from tessera_cli.messages import procman_process_t as states
from tessera_cli.supervision.attributes import RunOptions
from tessera_cli.supervision.command_list import LocalCommand, read_command_list
from tessera_cli.supervision.guard import Guard
from tessera_cli.supervision.process_list import Process
from tessera_cli.supervision.progress import FINISHED, RUNNING, StageReport
from tessera_cli.supervision.state_folder import LogFolder
from tessera_cli.supervision.supervised_process import READY, Supervised
from tessera_cli.supervision.supervisor import Crew
from tessera_cli.supervision.wishes import to_launch, to_wish

COMMANDS = ROOT / "procman" / "commands.pmd"
END_TURN_S = 0.01
# Of one core; waiting stages need one or two.
BUSY_PERCENT = 10.0
# A stage names itself first; who quotes its words has named it already.
OWN_NAME = re.compile(r"^tessera-[a-z-]+: ")


def helper(name: str, command: str, stop_time_allowed: float) -> Process:
    """A single process that ends by itself when its work is done."""
    return Process(
        name, command, "", 0, (), RunOptions(ready="started", auto_respawn="never", stop_time_allowed=stop_time_allowed)
    )


class PrivateDeputy:
    def __init__(
        self,
        folder: LogFolder,
        settings_path: Path,
        processes: Iterable[Process],
        commands: dict[str, LocalCommand] | None = None,
    ) -> None:
        """`commands`: what their names stand for; else those of the shipped list, in the caller's working folder."""
        commands = commands or read_command_list(COMMANDS, Path.cwd())
        values = {"bin": str(BIN), "settings": str(settings_path)}
        self._wanted = {process.name: to_launch(to_wish(process), commands, values, "", 0) for process in processes}
        self._commands = {name: launch.command for name, launch in self._wanted.items()}
        self._guard = Guard(folder.mark())
        self._crew = Crew(folder, lambda _name, _output: None)
        self._members: dict[str, Supervised] = {}  # also those that the crew has forgotten
        self._pids: set[int] = set()  # of all lives
        self._num_deaths_told: dict[str, int] = {}
        self.warnings: list[str] = []

    def start(self) -> None:
        self._crew.want(self._wanted, "")
        self._members = {member.name: member for member in self._crew.processes}
        self.step()

    @property
    def processes(self) -> list[Supervised]:
        return list(self._members.values())

    @property
    def not_ready(self) -> list[str]:
        return [member.name for member in self.processes if member.state not in READY]

    @property
    def ended(self) -> list[str]:
        """Those that ended by themselves, with status 0."""
        return [member.name for member in self.processes if member.state == states.ENDED]

    @property
    def is_over(self) -> bool:
        """Nothing runs, and nothing will."""
        return all(member.child is None and member.state in (states.ENDED, states.STOPPED) for member in self.processes)

    def is_busy(self, names: Iterable[str]) -> bool:
        """Whether one of them uses processor time: a stage in a long step says nothing meanwhile."""
        return any(
            member.child and member.usage.cpu_percent > BUSY_PERCENT
            for member in self.processes
            if member.name in names
        )

    def owns(self, pid: int) -> bool:
        return pid in self._pids

    def num_restarts(self, command: str) -> int:
        """Of all processes of this command of the list."""
        return sum(max(0, member.num_starts - 1) for member in self.processes if self._commands[member.name] == command)

    def hear(self, reports: Iterable[StageReport]) -> None:
        """The last STATUS of stages; the same ones may be told again."""
        for report in reports:
            if report.state in (RUNNING, FINISHED):
                self._crew.on_stage_status(report.name, report.pid, report.state == FINISHED, report.heard_at)

    def step(self) -> None:
        """Looks once at every process. Raises UserError or RunFailed when one is beyond help."""
        self._guard.watch()
        self._turn()
        for member in self.processes:
            if member.num_deaths > self._num_deaths_told.get(member.name, 0) and member.state == states.BACKING_OFF:
                self.warnings.append(f"{member.name} {member.last_death.how} and was started again.")
            self._num_deaths_told[member.name] = member.num_deaths
            if member.state == states.FAILED:
                raise _failure(member)

    def _turn(self) -> None:
        self._crew.step(time.monotonic())
        self._pids.update(member.child.pid for member in self.processes if member.child)

    def dismiss(self, names: Iterable[str]) -> None:
        """They end while the others go on, after what depends on them and has not done its last work."""
        for name in names:
            self._wanted.pop(name, None)
        self._crew.want(self._wanted, "")

    def end(self, names: Iterable[str] | None = None) -> None:
        """Returns when these (None: all) and what must end before them have ended; what does not listen in time is killed."""
        chosen = {
            member.name for member in self.processes if not member.is_idle and (names is None or member.name in names)
        }
        chosen |= {
            member.name for member in self.processes if member.state != states.FINISHED and chosen & set(member.depends)
        }
        self.dismiss(chosen)
        while not all(self._members[name].is_idle for name in chosen):
            self._turn()
            time.sleep(END_TURN_S)
        self.warnings += [
            f"{name} {self._members[name].reason}." for name in sorted(chosen) if self._members[name].reason
        ]

    def require_success(self, name: str) -> None:
        """Raises what its exit status and last words say if it did not end well."""
        death = self._members[name].last_death
        if death and death.status != 0:
            raise _failure(self._members[name])

    def last_words(self, name: str) -> str:
        return OWN_NAME.sub("", self._members[name].last_words)

    def kill(self) -> None:
        """All at once."""
        self.dismiss(list(self._wanted))
        for member in self.processes:
            member.kill()
        self._turn()
        self._guard.end()


def _failure(member: Supervised) -> Exception:
    death, words = member.last_death, OWN_NAME.sub("", member.last_words)
    if death is None:
        return RunFailed(f"{member.name} {member.reason}.")
    if death.status == 2:
        return UserError(f"{member.name}: {words}")
    return RunFailed(f"{member.name} {death.how}; the last line of {member.log.path}: {words}")
