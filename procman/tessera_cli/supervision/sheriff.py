"""Gives orders: knows all deputies by their status, signs orders and repeats them until they are obeyed or refused.

A sheriff keeps no state that would be missed: deputies keep their orders without it, and any other sheriff learns from
their status what runs.
"""

import os
import time
from argparse import Namespace
from collections.abc import Callable
from dataclasses import dataclass

from nacl.public import SealedBox
from nacl.signing import VerifyKey

from tessera_cli.cluster.keys import KeyRing, key_folder, to_text
from tessera_cli.constants import (
    DISCOVERY_S,
    DISTRUST_TIMEOUT_S,
    FIND_DEPUTY_TIMEOUT_S,
    LISTEN_S,
    LONGEST_TURN_S,
    ORDER_REPEAT_S,
    ORDER_TIMEOUT_S,
    PROCMAN_ORDER,
    PROCMAN_OUTPUT,
    PROCMAN_STATUS,
    SILENT_DEPUTY_S,
)
from tessera_cli.errors import RunError, UserError
from tessera_cli.lcm_bus import Bus, is_on_lan, listen, procman_url
from tessera_cli.messages import procman_order_t, procman_output_t, procman_process_t, procman_status_t
from tessera_cli.supervision.deputy_words import DeputyWords
from tessera_cli.supervision.orders import draw_order_id
from tessera_cli.supervision.process_list import Process
from tessera_cli.supervision.process_names import processes_of, split_name
from tessera_cli.supervision.signatures import sign
from tessera_cli.supervision.wishes import to_wish


@dataclass
class KnownDeputy:
    """The last status of a deputy."""

    status: procman_status_t
    received_at: float  # monotonic seconds

    @property
    def is_silent(self) -> bool:
        return time.monotonic() - self.received_at > SILENT_DEPUTY_S


@dataclass(frozen=True)
class Membership:
    """What the members of a list share."""

    secret: bytes
    deputies: tuple[str, ...]  # ids of those that have processes of the list


def _num_distrusted(status: procman_status_t) -> int:
    return sum(number for kind, number in zip(status.kinds, status.num_refused) if kind == "unknown key")


class Sheriff:
    """Lives as long as one command."""

    def __init__(self, arguments: Namespace) -> None:
        """`arguments`: --port and --lan."""
        self._ring = KeyRing(key_folder())
        self._key = self._ring.signing_key()
        trusted = set(self._ring.trusted().values())
        self._words = DeputyWords(lambda: trusted)
        self._is_on_lan = is_on_lan(arguments)
        self._bus = Bus(procman_url(arguments), f"sheriff_{os.getpid()}")
        self._status_handlers: list[Callable[[procman_status_t], None]] = []
        self._bus.subscribe(PROCMAN_STATUS, None, self._on_status)
        self._other_buses: list[Bus] = []
        # Deadlines count the time in which deputies could be heard, not that in which this process was suspended.
        self.listened_s = 0.0
        self.deputies: dict[str, KnownDeputy] = {}

    def _on_status(self, data: bytes) -> None:
        if (status := self._words.accept(procman_status_t, data)) is None:
            return
        self.deputies[status.deputy] = KnownDeputy(status, time.monotonic())
        for handler in self._status_handlers:
            handler(status)

    def on_status(self, handler: Callable[[procman_status_t], None]) -> None:
        self._status_handlers.append(handler)

    def on_output(self, handler: Callable[[procman_output_t], None]) -> None:
        def on_data(data: bytes) -> None:
            if (output := self._words.accept(procman_output_t, data)) is not None:
                handler(output)

        self._bus.subscribe(PROCMAN_OUTPUT, None, on_data)

    def also_listen_to(self, buses: list[Bus]) -> None:
        """While it listens to deputies; replaces those given before."""
        self._other_buses = buses

    def listen(self, seconds: float) -> None:
        """Handles what arrives within this time."""
        began = time.monotonic()
        listen([self._bus, *self._other_buses], seconds)
        self.listened_s += min(time.monotonic() - began, seconds + LONGEST_TURN_S)

    def listen_until(self, is_met: Callable[[], bool], seconds: float) -> bool:
        """Whether it was met within so many seconds of listening."""
        until_s = self.listened_s + seconds
        while not (met := is_met()) and self.listened_s <= until_s:
            self.listen(LISTEN_S)
        return met

    def discover_deputies(self) -> None:
        """Returns when every deputy was heard once. Raises RunError if there is none."""
        self.listen(DISCOVERY_S)
        if not self.deputies:
            hint = f"start one on each node: procman/tessera deputy{self._lan_hint()}"
            raise RunError(f"no deputy answers on {self._bus.url}: {self._unknown_hint() or hint}")

    def _lan_hint(self) -> str:
        return "" if self._is_on_lan else " (on other machines: --lan there and here)"

    def _unknown_hint(self) -> str:
        """What to do about deputies that are not believed; empty if there are none."""
        if not self._words.unknown:
            return ""
        name, key = next(iter(self._words.unknown.items()))
        return (
            f"{', '.join(self._words.unknown)} answers with a key that this user does not trust; compare it with "
            f"`procman/tessera keys` there, then: procman/tessera keys trust {name} {to_text(key)}"
        )

    def require_deputies(self, ids: list[str]) -> None:
        """Waits for them. Raises UserError that names those that do not answer."""
        if self.listen_until(lambda: self.deputies.keys() >= set(ids), FIND_DEPUTY_TIMEOUT_S):
            return
        missing = [name for name in ids if name not in self.deputies]
        if any(name in self._words.unknown for name in missing):
            raise UserError(f"{self._unknown_hint()}.")
        raise UserError(
            f"no deputy answers for {', '.join(missing)}; known: {', '.join(self.deputies) or 'none'}. "
            f"Start it there: procman/tessera deputy --id {missing[0]}{self._lan_hint()}"
        )

    def run(
        self,
        deputy: str,
        list_name: str,
        processes: list[Process],
        settings: list[str],
        session: str,
        membership: Membership | None = None,
    ) -> None:
        """The deputy is to run exactly these processes of the list; none: it ends, or all lists if it has no name.

        `membership`: None where messages are neither signed nor checked.
        Raises RunError with the deputy's sentence if it refuses.
        """
        order = procman_order_t()
        order.action, order.list, order.session = procman_order_t.RUN, list_name, session
        order.settings, order.num_settings = settings, len(settings)
        order.wishes = [to_wish(process) for process in processes]
        order.num_wishes = len(order.wishes)
        if membership:
            known = self.deputies[deputy].status.key
            order.secret = SealedBox(VerifyKey(known).to_curve25519_public_key()).encrypt(membership.secret)
            order.num_secret_bytes = len(order.secret)
            order.deputies = [name for name in membership.deputies if name in self.deputies]
            order.deputy_keys = [to_text(self.deputies[name].status.key) for name in order.deputies]
            order.num_deputies = len(order.deputies)
        self.send(deputy, order)

    def send(self, deputy: str, order: procman_order_t) -> str:
        """Repeats the order until the deputy has obeyed or refused it. Returns its id."""
        order.header, order.deputy, order.order = self._bus.header(PROCMAN_ORDER), deputy, draw_order_id()
        began_s, repeat_at, num_sent = self.listened_s, 0.0, 0
        distrusted = _num_distrusted(self.deputies[deputy].status)
        while (status := self.deputies[deputy].status).last_order != order.order:
            waited_s = self.listened_s - began_s
            is_distrusted = waited_s > DISTRUST_TIMEOUT_S and _num_distrusted(status) > distrusted
            if waited_s > ORDER_TIMEOUT_S or is_distrusted:
                raise RunError(self._explain_silence(deputy, num_sent))
            if time.monotonic() >= repeat_at:
                # Another sheriff may have used the number meanwhile, or the deputy may have been restarted.
                order.nonce, order.number = status.nonce, status.last_number + 1
                self._bus.publish(PROCMAN_ORDER, sign(order, self._key))
                num_sent += 1
                repeat_at = time.monotonic() + ORDER_REPEAT_S
            self.listen(LISTEN_S)
        if status.last_refusal:
            raise RunError(f"{deputy} refuses: {status.last_refusal}")
        return order.order

    def _explain_silence(self, deputy: str, num_sent: int) -> str:
        known = self.deputies[deputy]
        if known.is_silent:
            return f"the deputy {deputy} no longer answers."
        status = known.status
        refused = ", ".join(f"{number} {kind}" for kind, number in zip(status.kinds, status.num_refused))
        if not refused:
            return (
                f"the deputy {deputy} answers, but hears no orders ({num_sent} sent; its last was number "
                f"{status.last_number}): does its network let multicast in? Is its machine overloaded?"
            )
        return (
            f"the deputy {deputy} does not obey (it has refused: {refused}): does it trust this user's key? "
            "procman/tessera keys shows both."
        )

    def deputies_of(self, list_name: str) -> list[str]:
        """Those that have the list, sorted."""
        return sorted(
            name
            for name, deputy in self.deputies.items()
            if any(each.name == list_name for each in deputy.status.lists)
        )

    @property
    def lists(self) -> list[str]:
        """Names of the lists of all deputies, sorted."""
        return sorted({each.name for deputy in self.deputies.values() for each in deputy.status.lists})

    def processes(self) -> dict[str, tuple[str, procman_process_t]]:
        """Those of all deputies: (deputy, process) by full name."""
        return {
            full_name: (name, process)
            for name, deputy in sorted(self.deputies.items())
            for full_name, process in processes_of(deputy.status).items()
        }

    def find(self, name: str) -> str:
        """The full name of a process; the list may be left out where only one list has such a process."""
        names = list(self.processes())
        found = [name] if name in names else [each for each in names if split_name(each)[1] == name]
        if not found:
            raise UserError(f"no deputy has a process '{name}'; known: {', '.join(names) or 'none'}.")
        if len(found) > 1:
            raise UserError(f"several lists have a '{name}': say which, {' or '.join(found)}.")
        return found[0]
