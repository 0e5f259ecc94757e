"""The side of who gives orders: knows all deputies by their status, signs orders and repeats them until they are heard.

A sheriff has no state of its own that anybody would miss: deputies keep their orders without it, and any other one
finds what runs in their status.
"""

import os
import select
import time
from argparse import Namespace
from collections.abc import Callable
from dataclasses import dataclass

from tessera_cli.cluster.keys import KeyRing, key_folder
from tessera_cli.errors import RunFailed, UserError
from tessera_cli.lcm_bus import ORDER, OUTPUT, STATUS, Bus, procman_url, ttl_of
from tessera_cli.messages import procman_order_t, procman_output_t, procman_process_t, procman_status_t
from tessera_cli.supervision.orders import draw_order_id, sign
from tessera_cli.supervision.process_list import Process
from tessera_cli.supervision.process_names import processes_of, split
from tessera_cli.supervision.wishes import to_wish

TURN_S = 0.05
# Deputies speak once a second.
MEET_S = 1.3
SILENT_AFTER_S = 3.5
FIND_TIMEOUT_S = 5.0
ORDER_TIMEOUT_S = 15.0  # LCM's self-test on the deputy's side may take 10 s
# A deputy that meanwhile counts orders of strangers, and obeys none, counts ours.
DISTRUST_TIMEOUT_S = 3.0
REPEAT_S = 0.3


@dataclass
class Heard:
    status: procman_status_t
    at: float  # monotonic seconds

    @property
    def is_silent(self) -> bool:
        return time.monotonic() - self.at > SILENT_AFTER_S


def _num_distrusted(status: procman_status_t) -> int:
    return sum(number for kind, number in zip(status.kinds, status.num_refused) if kind == "unknown key")


class Sheriff:
    def __init__(self, arguments: Namespace) -> None:
        self._ring = KeyRing(key_folder())
        self._key = self._ring.signing_key()
        self._is_lan = bool(ttl_of(arguments))
        self._bus = Bus(procman_url(arguments), f"sheriff_{os.getpid()}")
        self._bus.subscribe(STATUS, procman_status_t, self._on_status)
        self._others: list[Bus] = []
        self.deputies: dict[str, Heard] = {}

    def _on_status(self, status: procman_status_t) -> None:
        self.deputies[status.deputy] = Heard(status, time.monotonic())

    def on_status(self, handler: Callable[[procman_status_t], None]) -> None:
        self._bus.subscribe(STATUS, procman_status_t, handler)

    def also_listen_to(self, buses: list[Bus]) -> None:
        """While it listens to deputies; instead of those given before."""
        self._others = buses

    def on_output(self, handler: Callable[[procman_output_t], None]) -> None:
        self._bus.subscribe(OUTPUT, procman_output_t, handler)

    def listen(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        while (left_s := until - time.monotonic()) > 0:
            for bus in select.select([self._bus, *self._others], [], [], left_s)[0]:
                bus.handle_waiting()

    def meet(self) -> None:
        """Hears every deputy once."""
        self.listen(MEET_S)
        if not self.deputies:
            raise RunFailed(
                f"no deputy answers on {self._bus.url}: start one on each node: procman/tessera deputy{self._hint()}"
            )

    def _hint(self) -> str:
        return "" if self._is_lan else " (on other machines: --lan there and here)"

    def require_deputies(self, ids: list[str]) -> None:
        until = time.monotonic() + FIND_TIMEOUT_S
        while missing := [name for name in ids if name not in self.deputies]:
            if time.monotonic() > until:
                raise UserError(
                    f"no deputy answers for {', '.join(missing)}; there is: {', '.join(self.deputies) or 'none'}. "
                    f"Start it there: procman/tessera deputy --id {missing[0]}{self._hint()}"
                )
            self.listen(TURN_S)

    def run(self, deputy: str, list_name: str, processes: list[Process], settings: list[str], session: str) -> None:
        """The deputy is to have exactly these processes of the list; none: it ends, and all lists if it has no name.

        Raises RunFailed with the deputy's sentence if it refuses.
        """
        order = procman_order_t()
        order.action, order.list, order.session = procman_order_t.RUN, list_name, session
        order.settings, order.num_settings = settings, len(settings)
        order.wishes = [to_wish(process) for process in processes]
        order.num_wishes = len(order.wishes)
        self.send(deputy, order)

    def send(self, deputy: str, order: procman_order_t) -> str:
        """Repeats it until the deputy has obeyed or refused it. Returns its id."""
        order.header, order.deputy, order.order = self._bus.header(ORDER), deputy, draw_order_id()
        began, repeat_at = time.monotonic(), 0.0
        distrusted = _num_distrusted(self.deputies[deputy].status)
        while (status := self.deputies[deputy].status).last_order != order.order:
            waited_s = time.monotonic() - began
            if waited_s > ORDER_TIMEOUT_S or (waited_s > DISTRUST_TIMEOUT_S and _num_distrusted(status) > distrusted):
                raise RunFailed(self._explain_silence(deputy, status))
            if time.monotonic() >= repeat_at:
                # Another sheriff may have taken the number meanwhile, and the deputy may have been started anew.
                order.nonce, order.number = status.nonce, status.last_number + 1
                self._bus.publish(ORDER, sign(order, self._key))
                repeat_at = time.monotonic() + REPEAT_S
            self.listen(TURN_S)
        if status.last_refusal:
            raise RunFailed(f"{deputy} refuses: {status.last_refusal}")
        return order.order

    def _explain_silence(self, deputy: str, status: procman_status_t) -> str:
        if self.deputies[deputy].is_silent:
            return f"the deputy {deputy} says nothing any more."
        refused = ", ".join(f"{number} {kind}" for kind, number in zip(status.kinds, status.num_refused))
        return (
            f"the deputy {deputy} does not obey (it has refused: {refused or 'none'}): does it trust this user's key? "
            "procman/tessera keys shows both."
        )

    def deputies_of(self, list_name: str) -> list[str]:
        """Those that have it, sorted."""
        return sorted(
            deputy
            for deputy, heard in self.deputies.items()
            if any(each.name == list_name for each in heard.status.lists)
        )

    @property
    def lists(self) -> list[str]:
        return sorted({each.name for heard in self.deputies.values() for each in heard.status.lists})

    def processes(self) -> dict[str, tuple[str, procman_process_t]]:
        """All of all deputies: (deputy, process) by LIST/PROCESS."""
        return {
            name: (deputy, process)
            for deputy, heard in sorted(self.deputies.items())
            for name, process in processes_of(heard.status).items()
        }

    def find(self, process: str) -> str:
        """LIST/PROCESS of what people call so; the list may be left out where only one has it."""
        names = list(self.processes())
        found = [process] if process in names else [name for name in names if split(name)[1] == process]
        if not found:
            raise UserError(f"no deputy has a process '{process}'; there is: {', '.join(names) or 'none'}.")
        if len(found) > 1:
            raise UserError(f"several lists have a '{process}': say which, {' or '.join(found)}.")
        return found[0]
