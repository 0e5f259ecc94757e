"""Carries out scripts of a process list, step by step: start, stop, restart, wait."""

import os
import time
from collections.abc import Callable, Iterable

from tessera_cli.errors import RunFailed
from tessera_cli.messages import procman_order_t
from tessera_cli.messages import procman_process_t as states
from tessera_cli.supervision.orders import draw_order_id
from tessera_cli.supervision.process_list import Process, ProcessList, ScriptStep
from tessera_cli.supervision.process_names import processes_of, qualify
from tessera_cli.supervision.sheriff import TURN_S, Sheriff
from tessera_cli.supervision.supervised_process import STATE_NAMES

# States that fulfil a wait. (What no deputy knows of is stopped.)
FULFILLED = {
    "ready": (states.READY, states.FINISHED),
    "finished": (states.FINISHED, states.ENDED),
    "stopped": (states.STOPPED, states.ENDED),
}
# States from which it will not come without another order.
HOPELESS = {"ready": (states.FAILED, states.ENDED), "finished": (states.FAILED,), "stopped": ()}


class ScriptRunner:
    """One run of one list: what was started so far is what the deputies are told to have."""

    def __init__(
        self, sheriff: Sheriff, name: str, process_list: ProcessList, settings: list[str], say: Callable[[str], None]
    ) -> None:
        """`name`: that the deputies know the list by."""
        self._sheriff, self._name, self._list, self._settings, self._say = sheriff, name, process_list, settings, say
        self._started: set[str] = set()
        self._session = draw_order_id()

    def host(self, process: Process) -> str:
        return process.host or os.uname().nodename

    @property
    def hosts(self) -> list[str]:
        return sorted({self.host(process) for process in self._list.processes.values()})

    def carry_out(self, script: str) -> None:
        """Raises RunFailed with the process, the reason and the step's place if a wait is in vain."""
        for step in self._list.scripts[script]:
            match step.action:
                case "run_script":
                    self.carry_out(step.script)
                case "start":
                    self.start(step.names)
                case "stop":
                    self.stop(step.names)
                case "restart":
                    self._restart(step.names)
                case "wait" if not step.status:
                    self._sheriff.listen(step.seconds)
                case "wait":
                    self._wait_of(step)

    def start(self, names: Iterable[str]) -> None:
        self._started.update(names)
        self._order(names)

    def stop(self, names: Iterable[str]) -> None:
        self._started.difference_update(names)
        self._order(names)

    def leave_other_hosts(self) -> None:
        """Nodes that have the list from before and are not in it any more."""
        for deputy in self._sheriff.deputies_of(self._name):
            if deputy not in self.hosts:
                self._sheriff.run(deputy, self._name, [], [], self._session)

    def _order(self, names: Iterable[str]) -> None:
        hosts = {self.host(self._list.processes[name]) for name in names}
        for host in sorted(hosts):
            wanted = [
                process
                for name, process in self._list.processes.items()
                if name in self._started and self.host(process) == host
            ]
            self._sheriff.run(host, self._name, wanted, self._settings, self._session)

    def _restart(self, names: Iterable[str]) -> None:
        for name in names:
            order = procman_order_t()
            order.action, order.process = procman_order_t.RESTART, qualify(self._name, name)
            self._sheriff.send(self.host(self._list.processes[name]), order)

    def _wait_of(self, step: ScriptStep) -> None:
        try:
            self.wait(step.names, step.status, step.seconds)
        except RunFailed as error:
            raise RunFailed(f"{step.place.path.name}:{step.place.line}: {error}") from error

    def wait(self, names: Iterable[str], status: str, timeout_s: float) -> None:
        """Until all are `status`: ready, finished or stopped. Raises RunFailed that names those that are not, and why."""
        until = time.monotonic() + timeout_s
        told: dict[str, str] = {}
        while missing := [name for name in names if self._state(name) not in FULFILLED[status]]:
            self._tell_changes(missing, told)
            if hopeless := [name for name in missing if self._state(name) in HOPELESS[status]]:
                raise RunFailed(f"{self._describe(hopeless[0])}.")
            if time.monotonic() > until:
                raise RunFailed(f"not {status} within {timeout_s:g} s: {'; '.join(map(self._describe, missing[:5]))}.")
            self._sheriff.listen(TURN_S)

    def _state(self, name: str) -> int:
        process = self._process(name)
        return process.state if process else states.STOPPED

    def _process(self, name: str) -> states | None:
        heard = self._sheriff.deputies.get(self.host(self._list.processes[name]))
        return processes_of(heard.status).get(qualify(self._name, name)) if heard else None

    def _describe(self, name: str) -> str:
        host = self.host(self._list.processes[name])
        heard = self._sheriff.deputies.get(host)
        if heard is None or heard.is_silent:
            return f"{name}: its deputy {host} says nothing any more"
        if process := self._process(name):
            return f"{name} on {host} is {STATE_NAMES.get(process.state, '?')}" + (
                f": {process.reason}" if process.reason else ""
            )
        return f"{name} on {host} is not started"

    def _tell_changes(self, names: list[str], told: dict[str, str]) -> None:
        """Says once what has gone wrong on the way and was mended."""
        for name in names:
            if self._state(name) == states.BACKING_OFF and told.get(name) != (sentence := self._describe(name)):
                told[name] = sentence
                self._say(sentence)
