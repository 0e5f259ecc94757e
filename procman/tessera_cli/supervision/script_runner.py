"""Carries out scripts of a process list, step by step: start, stop, restart, wait."""

import os
from collections.abc import Callable, Iterable

from tessera_cli.constants import LISTEN_S
from tessera_cli.errors import RunError
from tessera_cli.messages import procman_order_t
from tessera_cli.messages import procman_process_t as states
from tessera_cli.supervision.orders import draw_order_id
from tessera_cli.supervision.process_list import Process, ProcessList, ScriptStep
from tessera_cli.supervision.process_names import full_name, processes_of
from tessera_cli.supervision.sheriff import Membership, Sheriff
from tessera_cli.supervision.supervised_process import STATE_NAMES

# States that fulfill a wait. A process that no deputy knows is stopped.
FULFILLED = {
    "ready": (states.READY, states.FINISHED),
    "finished": (states.FINISHED, states.ENDED),
    "stopped": (states.STOPPED, states.ENDED),
}
# States that a process leaves only by another order.
HOPELESS = {"ready": (states.FAILED, states.ENDED), "finished": (states.FAILED,), "stopped": ()}
MAX_DESCRIBED = 5


def host_of(process: Process) -> str:
    """The id of its deputy."""
    return process.host or os.uname().nodename


def hosts_of(process_list: ProcessList) -> list[str]:
    """The ids of all deputies that the list needs, sorted."""
    return sorted({host_of(process) for process in process_list.processes.values()})


class ScriptRunner:
    """One run of one list. The deputies are told to have what was started so far."""

    def __init__(
        self,
        sheriff: Sheriff,
        name: str,
        process_list: ProcessList,
        settings: list[str],
        secret: bytes | None,
        say: Callable[[str], None],
    ) -> None:
        """`name`: of the list, as the deputies know it. `secret`: of its members; None: they do without."""
        self._sheriff, self._name, self._list, self._settings, self._say = sheriff, name, process_list, settings, say
        self._membership = Membership(secret, tuple(hosts_of(process_list))) if secret else None
        self._started: set[str] = set()
        self._session = draw_order_id()

    def run(self, script: str) -> None:
        """Raises RunError with the process, the reason and the step's place if a wait is in vain."""
        for step in self._list.scripts[script]:
            match step.action:
                case "run_script":
                    self.run(step.script)
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

    def end_on_other_hosts(self) -> None:
        """On nodes that still run an earlier version of the list and are no longer in it."""
        for deputy in self._sheriff.deputies_of(self._name):
            if deputy not in hosts_of(self._list):
                self._sheriff.run(deputy, self._name, [], [], self._session)

    def _order(self, names: Iterable[str]) -> None:
        for host in sorted({host_of(self._list.processes[name]) for name in names}):
            started = [process for name, process in self._list.processes.items() if name in self._started]
            wanted = [process for process in started if host_of(process) == host]
            self._sheriff.run(host, self._name, wanted, self._settings, self._session, self._membership)

    def _restart(self, names: Iterable[str]) -> None:
        for name in names:
            order = procman_order_t()
            order.action, order.process = procman_order_t.RESTART, full_name(self._name, name)
            self._sheriff.send(host_of(self._list.processes[name]), order)

    def _wait_of(self, step: ScriptStep) -> None:
        try:
            self.wait(step.names, step.status, step.seconds)
        except RunError as error:
            raise RunError(f"{step.place.path.name}:{step.place.line}: {error}") from error

    def wait(self, names: Iterable[str], status: str, timeout_s: float) -> None:
        """Until all are `status`: ready, finished or stopped. Raises RunError with the reason if that fails."""
        until_s = self._sheriff.listened_s + timeout_s
        reported: dict[str, str] = {}
        while missing := [name for name in names if self._state(name) not in FULFILLED[status]]:
            self._report_restarts(missing, reported)
            if hopeless := [name for name in missing if self._state(name) in HOPELESS[status]]:
                raise RunError(f"{self._describe(hopeless[0])}.")
            if self._sheriff.listened_s > until_s:
                described = "; ".join(map(self._describe, missing[:MAX_DESCRIBED]))
                raise RunError(f"not {status} within {timeout_s:g} s: {described}.")
            self._sheriff.listen(LISTEN_S)

    def _state(self, name: str) -> int:
        process = self._process(name)
        return process.state if process else states.STOPPED

    def _process(self, name: str) -> states | None:
        deputy = self._sheriff.deputies.get(host_of(self._list.processes[name]))
        return processes_of(deputy.status).get(full_name(self._name, name)) if deputy else None

    def _describe(self, name: str) -> str:
        host = host_of(self._list.processes[name])
        deputy = self._sheriff.deputies.get(host)
        if deputy is None or deputy.is_silent:
            return f"{name}: its deputy {host} no longer answers"
        if process := self._process(name):
            reason = f": {process.reason}" if process.reason else ""
            return f"{name} on {host} is {STATE_NAMES.get(process.state, '?')}{reason}"
        return f"{name} on {host} is not started"

    def _report_restarts(self, names: list[str], reported: dict[str, str]) -> None:
        """Says once for each failure that a process is being restarted."""
        for name in names:
            if self._state(name) == states.BACKING_OFF and reported.get(name) != (sentence := self._describe(name)):
                reported[name] = sentence
                self._say(sentence)
