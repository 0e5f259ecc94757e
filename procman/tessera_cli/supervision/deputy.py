"""tessera deputy: one on each node. Starts, watches and ends the processes that signed orders name.

It needs nobody to keep going: without a sheriff it keeps its last orders, and takes them up again when it is started
anew. Several lists run beside each other, each with settings, a bus and orders of its own. When it dies, a guard ends what it left.
"""

import os
import select
import time
from argparse import Namespace
from pathlib import Path

from tessera_cli import settings
from tessera_cli.cluster.keys import KeyRing, key_folder
from tessera_cli.errors import RunFailed, UserError
from tessera_cli.files import BIN, ROOT
from tessera_cli.interrupt import Interrupt
from tessera_cli.lcm_bus import ORDER, STATUS, Bus, procman_url
from tessera_cli.messages import procman_order_t, procman_status_t, stage_status_t
from tessera_cli.supervision.attributes import HOST
from tessera_cli.supervision.command_list import read_command_list
from tessera_cli.supervision.deputy_status import make_status
from tessera_cli.supervision.guard import Guard
from tessera_cli.supervision.orders import Gate
from tessera_cli.supervision.output_forwarder import OutputForwarder
from tessera_cli.supervision.process_names import LIST, qualify, split
from tessera_cli.supervision.progress import FINISHED
from tessera_cli.supervision.running_list import RunningList, listen_to
from tessera_cli.supervision.state_folder import StateFolder
from tessera_cli.supervision.supervisor import Crew
from tessera_cli.supervision.wishes import run_of, to_launch

STATUS_PERIOD_S = 1.0
TURN_S = 0.05
# Another deputy with our id speaks once a second.
LISTEN_FOR_TWINS_S = 1.5


def main(arguments: Namespace) -> int:
    deputy_id = arguments.id or os.uname().nodename
    if not HOST.fullmatch(deputy_id):
        raise UserError(f"the id '{deputy_id}' must have letters, digits, _ . and - only.")
    path = (
        Path(arguments.folder).expanduser().absolute()
        if arguments.folder
        else ROOT / "logs" / "deputies" / f"{deputy_id}-{arguments.port}"
    )
    return Deputy(
        deputy_id,
        StateFolder(path, deputy_id),
        Path(arguments.commands).expanduser().absolute(),
        procman_url(arguments),
        not arguments.fresh,
    ).run()


class Deputy:
    def __init__(self, deputy_id: str, folder: StateFolder, commands_path: Path, url: str, resumes: bool) -> None:
        self._id, self._folder, self._resumes = deputy_id, folder, resumes
        self._commands = read_command_list(commands_path)
        self._ring = KeyRing(key_folder())
        self._ring.trusted()  # a fault in the file is told now
        self.gate = Gate(deputy_id, self._trusted)
        self._bus = Bus(url, f"deputy_{deputy_id}")
        self._lists: dict[str, RunningList] = {}
        self._output = OutputForwarder(self._bus, deputy_id)
        self._crew = Crew(folder, self._output.add)
        self._last_order, self._last_refusal = "", ""
        self._num_restarts = 0
        self._twin = ""
        self._told: tuple = ()
        self._status_at = 0.0
        self._trouble = ""

    def run(self) -> int:
        interrupt = Interrupt()
        self._bus.subscribe(STATUS, procman_status_t, self._on_deputy)
        self._look_for_twins()
        self._bus.subscribe(ORDER, None, self._on_order)
        guard = Guard(self._folder.mark())
        self._say(f"deputy {self._id} on {self._bus.url}; logs in {self._folder.path / 'logs'}")
        if self._resumes:
            self._resume()
        while not interrupt.requested:
            self._turn()
            guard.watch()
        self._say("ending all processes")
        self._crew.want({}, "")
        while not self._crew.is_idle:
            self._turn()
        self._publish_status()
        return guard.end()

    def _say(self, sentence: str) -> None:
        print(f"tessera: {sentence}", flush=True)

    def _trusted(self) -> list[bytes]:
        """Read anew for each order, so that keys can be revoked. A file that makes no sense makes nobody trusted."""
        try:
            self._trouble = ""
            return list(self._ring.trusted().values())
        except (UserError, OSError, UnicodeDecodeError) as error:
            self._trouble = str(error)
            return []

    def _look_for_twins(self) -> None:
        until = time.monotonic() + LISTEN_FOR_TWINS_S
        while time.monotonic() < until and not self._twin:
            self._wait(TURN_S, [self._bus])
            self._bus.handle_waiting()
        if self._twin:
            raise UserError(
                f"a deputy with the id {self._id} runs on {self._twin} already: give one of them another --id NAME."
            )

    def _turn(self) -> None:
        buses = [self._bus, *(each.bus for each in self._lists.values())]
        self._wait(TURN_S, buses + self._crew.talkers)
        for bus in buses:
            bus.handle_waiting()
        now = time.monotonic()
        self._crew.step(now)
        self._output.flush(now)
        facts = (self._last_order, self._last_refusal, self._crew.facts)
        for sentence in self._crew.news():
            self._say(sentence)
        if facts != self._told or now - self._status_at >= STATUS_PERIOD_S:
            self._told = facts
            self._publish_status()

    @staticmethod
    def _wait(seconds: float, sources: list) -> None:
        select.select(sources, [], [], seconds)

    def _on_deputy(self, status: procman_status_t) -> None:
        if status.deputy == self._id and status.nonce != self.gate.nonce:
            if not self._twin:
                self._say(f"another deputy with the id {self._id} speaks, on {status.host}")
            self._twin = status.host
            return
        for each in status.lists:
            if each.name in self._lists and each.run == self._lists[each.name].run:
                self._crew.hear_of_others(
                    {qualify(each.name, process.name): process.state for process in each.processes}, time.monotonic()
                )

    def _on_stage(self, list_name: str, status: stage_status_t) -> None:
        self._crew.on_stage_status(
            qualify(list_name, status.name), status.pid, status.state == FINISHED, time.monotonic()
        )

    def _on_order(self, data: bytes) -> None:
        order = self.gate.check(data)
        if self._trouble:
            self._say(self._trouble)
        if order is None:
            return
        self._last_order, self._last_refusal = order.order, ""
        try:
            self._obey(order)
            if order.action == procman_order_t.RUN and order.wishes:
                self._folder.keep_order(order.list, data)
        except (UserError, RunFailed, OSError) as error:
            self._last_refusal = str(error)
            self._say(f"order refused: {error}")
        self._publish_status()

    def _resume(self) -> None:
        """Takes up each list's last order of an earlier life: it was fresh then, and must still be signed by who is trusted."""
        for data in self._folder.last_orders():
            order = self.gate.recognize(data)
            if order is None or order.action != procman_order_t.RUN:
                continue
            self._say(f"going on with the last order of {order.list}: {', '.join(wish.name for wish in order.wishes)}")
            try:
                self._obey(order)
            except (UserError, RunFailed, OSError) as error:
                self._say(f"order refused: {error}")

    def _obey(self, order: procman_order_t) -> None:
        if order.action == procman_order_t.RUN:
            self._obey_run(order)
        elif order.process not in self._crew.names:
            raise UserError(
                f"the deputy {self._id} has no process '{order.process}'; it has: {', '.join(self._crew.names) or 'none'}."
            )
        elif order.action == procman_order_t.RESTART:
            self._num_restarts += 1
            self._crew.restart(order.process, self._num_restarts)
        elif order.action == procman_order_t.TAIL:
            self._output.send_tail(order.process, order.order, self._crew.tail(order.process, order.num_lines))
        else:
            raise UserError(f"there is no action {order.action}.")

    def _obey_run(self, order: procman_order_t) -> None:
        """All or nothing: a list with one bad wish changes nothing."""
        if not order.wishes:
            self._end(order.list, order.session)
            return
        names = [wish.name for wish in order.wishes]
        if len(set(names)) < len(names):
            raise UserError("two wishes have the same name.")
        if not LIST.fullmatch(order.list):
            raise UserError(f"'{order.list}' is no name of a list.")
        run = run_of(order.settings)
        values = {"bin": str(BIN), "settings": str(self._folder.settings_path(run))}
        generations = self._crew.generations(run)
        launches = {}
        for wish in order.wishes:
            name = qualify(order.list, wish.name)
            launches[name] = to_launch(wish, self._commands, values, run, generations.get(name, 0), order.list)
        if order.list not in self._lists or run != self._lists[order.list].run:
            self._begin(order.list, run, order.settings)
        self._forget_ended(order.list)
        self._crew.want(launches, order.session, qualify(order.list, ""))

    def _begin(self, list_name: str, run: str, assignments: list[str]) -> None:
        merged = settings.write_settings(assignments, self._folder.settings_path(run))
        self._lists[list_name] = listen_to(list_name, run, merged, f"deputy_{self._id}", self._on_stage)
        self._crew.forget_others(qualify(list_name, ""))
        self._folder.keep_settings({each.run for each in self._lists.values()})

    def _end(self, list_name: str, session: str) -> None:
        """All lists if it is empty."""
        for name in list(self._lists):
            if list_name in ("", name):
                self._crew.want({}, session, qualify(name, ""))
        self._folder.forget_orders(list_name)

    def _forget_ended(self, ordered: str) -> None:
        """Other lists of which nothing is left but what was shown as stopped."""
        for name in list(self._lists):
            if name != ordered and all(
                member.is_idle for member in self._crew.processes if split(member.name)[0] == name
            ):
                self._crew.want({}, "", qualify(name, ""))
                del self._lists[name]

    def _publish_status(self) -> None:
        self._status_at = time.monotonic()
        status = make_status(
            self._bus.header(STATUS), self.gate, self._lists.values(), self._crew.processes, self._status_at
        )
        status.last_order, status.last_refusal = self._last_order, self._last_refusal
        self._bus.publish(STATUS, status.encode())
