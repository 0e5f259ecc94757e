"""The deputy of a node: starts, watches and ends the processes that signed orders name.

It needs no sheriff to keep going: it keeps its last orders, and resumes them when it is restarted. Several lists run
beside each other, each with settings, a bus and orders of its own. When it dies, a guard ends what it left behind.
"""

import os
import select
import time
from argparse import Namespace
from pathlib import Path
from typing import Any

from nacl.exceptions import CryptoError
from nacl.public import SealedBox

from tessera_cli import settings
from tessera_cli.cluster.keys import KeyRing, from_text, key_folder
from tessera_cli.console import say
from tessera_cli.constants import (
    DEPUTY_STATUS_PERIOD_S,
    DUPLICATE_DEPUTY_S,
    LISTEN_S,
    PROCMAN_ORDER,
    PROCMAN_STATUS,
)
from tessera_cli.errors import RunError, UserError
from tessera_cli.files import BIN, ROOT, absolute
from tessera_cli.interrupt import Interrupt
from tessera_cli.lcm_bus import Bus, listen, procman_url
from tessera_cli.messages import procman_order_t, procman_status_t, stage_status_t
from tessera_cli.supervision.attributes import HOST
from tessera_cli.supervision.child_process import Launch
from tessera_cli.supervision.command_list import read_command_list
from tessera_cli.supervision.deputy_status import make_status
from tessera_cli.supervision.deputy_words import DeputyWords
from tessera_cli.supervision.guard import Guard
from tessera_cli.supervision.orders import OrderVerifier
from tessera_cli.supervision.output_forwarder import OutputForwarder
from tessera_cli.supervision.process_names import LIST_NAME, full_name, split_name
from tessera_cli.supervision.running_list import RunningList, listen_to
from tessera_cli.supervision.signatures import sign
from tessera_cli.supervision.state_folder import StateFolder
from tessera_cli.supervision.supervisor import Supervisor
from tessera_cli.supervision.wishes import run_of, to_launch
from tessera_cli.supervision.write_limits import refuse_writing_elsewhere
from tessera_cli.text import visible
from tessera_cli.versions import tessera_version


def run_deputy(arguments: Namespace) -> int:
    """`tessera deputy`. Returns when a signal has ended it and all its processes."""
    deputy_id = arguments.id or os.uname().nodename
    if not HOST.fullmatch(deputy_id):
        raise UserError(f"the id '{deputy_id}' must have letters, digits, _ . and - only.")
    path = absolute(arguments.folder) if arguments.folder else _default_folder(deputy_id, arguments.port)
    folder = StateFolder(path, deputy_id)
    return Deputy(folder, deputy_id, absolute(arguments.commands), procman_url(arguments)).run(not arguments.fresh)


def _default_folder(deputy_id: str, port: int) -> Path:
    return ROOT / "logs" / "deputies" / f"{deputy_id}-{port}"


class Deputy:
    """One on each node."""

    def __init__(self, folder: StateFolder, deputy_id: str, commands_path: Path, url: str) -> None:
        self._id, self._folder = deputy_id, folder
        self._commands = read_command_list(commands_path)
        self._ring = KeyRing(key_folder())
        self._ring.trusted()  # an error in the file is reported now
        self._key = self._ring.signing_key()
        self._verifier = OrderVerifier(deputy_id, self._trusted_keys)
        self._words = DeputyWords(self._believed_keys)
        epoch_us, self._earlier_epochs = folder.begin_epoch()
        self._bus = Bus(url, f"deputy_{deputy_id}", epoch_us)
        self._lists: dict[str, RunningList] = {}
        self._output = OutputForwarder(self._bus, deputy_id, self._key)
        self._supervisor = Supervisor(folder, self._output.add)
        self._last_order, self._last_refusal = "", ""
        self._num_restarts = 0
        self._duplicate_host = ""  # of another deputy with our id
        self._published: tuple[Any, ...] = ()
        self._status_at = 0.0
        self._key_error = ""

    def run(self, resumes: bool) -> int:
        """Until a signal. `resumes`: begins with the last orders. Returns 0 if no process is left."""
        interrupt = Interrupt()
        self._bus.subscribe(PROCMAN_STATUS, None, self._on_deputy)
        self._look_for_duplicates()
        self._bus.subscribe(PROCMAN_ORDER, None, self._on_order)
        guard = Guard(self._folder.mark())
        logs = self._folder.path / "logs"
        say(f"deputy {self._id} of version {tessera_version()} on {self._bus.url}; logs in {logs}")
        if resumes:
            self._resume()
        while not interrupt.requested:
            self._turn()
            guard.watch()
        say("ending all processes")
        self._supervisor.set_wanted({}, "")
        while not self._supervisor.is_idle:
            self._turn()
        self._publish_status()
        return guard.end()

    def _trusted_keys(self) -> list[bytes]:
        """Read again for each order, so that keys can be revoked. If the file is invalid, nobody is trusted."""
        try:
            self._key_error = ""
            return list(self._ring.trusted().values())
        except (UserError, OSError, UnicodeDecodeError) as error:
            self._key_error = str(error)
            return []

    def _believed_keys(self) -> set[bytes]:
        """Of deputies: trusted ones, and those that a sheriff who was obeyed has named."""
        return set(self._trusted_keys()).union(*(each.keys for each in self._lists.values()))

    def _look_for_duplicates(self) -> None:
        until = time.monotonic() + DUPLICATE_DEPUTY_S
        while time.monotonic() < until and not self._duplicate_host:
            listen([self._bus], LISTEN_S)
        if self._duplicate_host:
            raise UserError(
                f"a deputy with the id {self._id} already runs on {self._duplicate_host}: "
                "give one of them another --id NAME."
            )

    def _turn(self) -> None:
        buses = [self._bus, *(each.bus for each in self._lists.values())]
        sources: list[Any] = [*buses, *self._supervisor.readable_children]
        select.select(sources, [], [], LISTEN_S)
        for bus in buses:
            bus.handle_waiting()
        now = time.monotonic()
        self._supervisor.step(now)
        self._output.flush(now)
        for sentence in self._supervisor.state_changes():
            say(sentence)
        content = (self._last_order, self._last_refusal, self._supervisor.snapshot)
        if content != self._published or now - self._status_at >= DEPUTY_STATUS_PERIOD_S:
            self._published = content
            self._publish_status()

    def _on_deputy(self, data: bytes) -> None:
        status = self._words.accept(procman_status_t, data)
        # What this deputy said in an earlier life, somebody may have kept.
        if status is None or (status.deputy == self._id and status.header.epoch_us in self._earlier_epochs):
            return
        if status.deputy == self._id and bytes(status.nonce) != self._verifier.nonce:
            if not self._duplicate_host:
                say(f"another deputy with the id {self._id} runs on {status.host}")
            self._duplicate_host = status.host
            return
        for each in status.lists:
            if each.name in self._lists and each.run == self._lists[each.name].run:
                states = {full_name(each.name, process.name): process.state for process in each.processes}
                self._supervisor.set_remote_states(states, time.monotonic())

    def _on_stage(self, list_name: str, status: stage_status_t) -> None:
        name, is_finished = full_name(list_name, status.name), status.state == stage_status_t.FINISHED
        self._supervisor.on_stage_status(name, status.pid, is_finished, time.monotonic())

    def _on_order(self, data: bytes) -> None:
        order = self._verifier.accept(data)
        if self._key_error:
            say(self._key_error)
        if order is None:
            return
        self._last_order, self._last_refusal = order.order, ""
        try:
            self._obey(order)
            if order.action == procman_order_t.RUN and order.wishes:
                self._folder.keep_order(order.list, data)
        except (UserError, RunError, OSError) as error:
            self._last_refusal = visible(str(error))
            say(f"order refused: {self._last_refusal}")
        self._publish_status()

    def _resume(self) -> None:
        """Obeys each list's last order again, if its key is still trusted."""
        for data in self._folder.last_orders():
            order = self._verifier.accept_again(data)
            if order is None or order.action != procman_order_t.RUN:
                continue
            say(f"resuming the last order of {order.list}: {', '.join(wish.name for wish in order.wishes)}")
            try:
                self._obey(order, is_resumed=True)
            except (UserError, RunError, OSError) as error:
                say(visible(f"order refused: {error}"))

    def _obey(self, order: procman_order_t, is_resumed: bool = False) -> None:
        if order.action == procman_order_t.RUN:
            self._obey_run(order, is_resumed)
        elif order.process not in self._supervisor.names:
            known = ", ".join(self._supervisor.names) or "none"
            raise UserError(f"the deputy {self._id} has no process '{order.process}'; it has: {known}.")
        elif order.action == procman_order_t.RESTART:
            self._num_restarts += 1
            self._supervisor.restart(order.process, self._num_restarts)
        elif order.action == procman_order_t.TAIL:
            tail = self._supervisor.log_tail(order.process, order.num_lines)
            self._output.send_tail(order.process, order.order, tail)
        else:
            raise UserError(f"there is no action {order.action}.")

    def _obey_run(self, order: procman_order_t, is_resumed: bool) -> None:
        """All or nothing: a list with one bad wish changes nothing.

        Stages of a list that is resumed continue by the journals that they kept under an earlier deputy.
        """
        if not order.wishes:
            self._end(order.list, order.session)
            return
        names = [wish.name for wish in order.wishes]
        if len(set(names)) < len(names):
            raise UserError("two wishes have the same name.")
        if not LIST_NAME.fullmatch(order.list):
            raise UserError(f"'{order.list}' is no valid name of a list.")
        secret = self._open_secret(order)
        run = run_of(order.settings, secret)
        launches = self._launches(order, run)
        if order.list not in self._lists or run != self._lists[order.list].run:
            self._begin(order, run, secret)
            if not is_resumed:
                self._folder.run_dir(order.list).forget_journals()
        self._forget_ended(order.list)
        self._supervisor.set_wanted(launches, order.session, full_name(order.list, ""))

    def _launches(self, order: procman_order_t, run: str) -> dict[str, Launch]:
        """What the order asks for, by full name."""
        values = {"bin": str(BIN), "settings": str(self._folder.settings_path(run))}
        generations = self._supervisor.generations(run)
        launches = {}
        for wish in order.wishes:
            name = full_name(order.list, wish.name)
            launches[name] = to_launch(wish, self._commands, values, run, generations.get(name, 0), order.list)
        return launches

    def _open_secret(self, order: procman_order_t) -> bytes | None:
        """Of the list's members; None if they do without. Raises UserError if it is not meant for this deputy."""
        if not order.num_secret_bytes:
            return None
        try:
            return SealedBox(self._key.to_curve25519_private_key()).decrypt(bytes(order.secret))
        except (CryptoError, ValueError) as error:
            raise UserError(f"the order's secret is sealed for another key than that of {self._id}.") from error

    def _begin(self, order: procman_order_t, run: str, secret: bytes | None) -> None:
        run_dir = self._folder.run_dir(order.list)
        assignments = [
            *order.settings,
            f"bus.run_dir={run_dir.path if secret else ''}",
            f"stream.journal_dir={run_dir.journals}",
        ]
        merged = settings.write_settings(assignments, self._folder.settings_path(run))
        refuse_writing_elsewhere(merged, [path for command in self._commands.values() for path in command.writes])
        if secret:
            run_dir.make(secret)
        try:
            keys = frozenset(from_text(text) for text in order.deputy_keys)
        except ValueError as error:
            raise UserError(f"a key of the list's deputies is none: {error}.") from error
        publisher = f"deputy_{self._id}"
        self._lists[order.list] = listen_to(order.list, run, merged, keys, publisher, self._on_stage)
        self._supervisor.forget_remote_states(full_name(order.list, ""))
        self._folder.keep_settings({each.run for each in self._lists.values()})

    def _end(self, list_name: str, session: str) -> None:
        """All lists if the name is empty."""
        for name in list(self._lists):
            if list_name in ("", name):
                self._supervisor.set_wanted({}, session, full_name(name, ""))
                self._folder.run_dir(name).forget_journals()
        self._folder.forget_orders(list_name)

    def _forget_ended(self, ordered: str) -> None:
        """Other lists of which no process is left; until now they were still shown as stopped."""
        for name in list(self._lists):
            own = [process for process in self._supervisor.processes if split_name(process.name)[0] == name]
            if name != ordered and all(process.is_idle for process in own):
                self._supervisor.set_wanted({}, "", full_name(name, ""))
                del self._lists[name]

    def _publish_status(self) -> None:
        self._status_at = time.monotonic()
        header, lists = self._bus.header(PROCMAN_STATUS), self._lists.values()
        status = make_status(header, self._verifier, lists, self._supervisor.processes, self._status_at)
        status.last_order, status.last_refusal = self._last_order, self._last_refusal
        self._bus.publish(PROCMAN_STATUS, sign(status, self._key))
