"""Decides which of the orders that a deputy receives are obeyed."""

import secrets
from collections import Counter
from collections.abc import Callable, Iterable

from tessera_cli.messages import procman_order_t
from tessera_cli.supervision.signatures import authenticate

NONCE_BYTES = 16
# Each order of a sheriff has the next number. One far beyond would leave no room for those after it.
MAX_NUMBER_STEP = 1_000_000


def draw_nonce() -> bytes:
    return secrets.token_bytes(NONCE_BYTES)


def draw_order_id() -> str:
    return secrets.token_hex(8)


class OrderVerifier:
    """Of one deputy, from its start to its end. Counts the orders that it refuses, by kind."""

    def __init__(self, deputy: str, trusted: Callable[[], Iterable[bytes]]) -> None:
        """`trusted`: returns the public keys that are obeyed at this moment."""
        self.deputy = deputy
        self._trusted = trusted
        self.nonce = draw_nonce()
        self.last_number = 0
        self.num_accepted = 0
        self.num_for_others = 0
        self.refused: Counter[str] = Counter()

    def accept(self, data: bytes) -> procman_order_t | None:
        """The order if it is to be obeyed. It is accepted once: the same bytes are a replay from then on."""
        order, refusal = authenticate(procman_order_t, data, set(self._trusted()))
        if order is None:
            self.refused[refusal] += 1
            return None
        if order.deputy != self.deputy:
            self.num_for_others += 1
            return None
        if refusal := self._judge_number(order):
            self.refused[refusal] += 1
            return None
        self.last_number = order.number
        self.num_accepted += 1
        return order

    def _judge_number(self, order: procman_order_t) -> str:
        """The kind of refusal; empty: none."""
        if order.nonce != self.nonce:
            return "stale"
        if order.number <= self.last_number:
            return "replayed"
        return "implausible" if order.number > self.last_number + MAX_NUMBER_STEP else ""

    def accept_again(self, data: bytes) -> procman_order_t | None:
        """An order for this deputy that it accepted before its restart, if its key is still trusted."""
        order, _ = authenticate(procman_order_t, data, set(self._trusted()))
        return order if order is not None and order.deputy == self.deputy else None
