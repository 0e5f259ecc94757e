"""Signs orders, and decides which of those received are obeyed.

  signature = Ed25519(secret key, "tessera procman order" + encoded order without its last 64 bytes)

The last 96 bytes of an encoded order are its key and its signature. They are checked before anything is decoded.
"""

import secrets
from collections import Counter
from collections.abc import Callable, Iterable

from nacl.exceptions import BadSignatureError
from nacl.signing import SigningKey, VerifyKey

from tessera_cli.constants import MAX_ORDER_BYTES
from tessera_cli.messages import decode, procman_order_t

CONTEXT = b"tessera procman order"  # the signature of anything else is not valid for an order
KEY_BYTES, SIGNATURE_BYTES, NONCE_BYTES = 32, 64, 16
MIN_BYTES = 8 + KEY_BYTES + SIGNATURE_BYTES
FINGERPRINT = procman_order_t().encode()[:8]


def draw_nonce() -> bytes:
    return secrets.token_bytes(NONCE_BYTES)


def draw_order_id() -> str:
    return secrets.token_hex(8)


def sign(order: procman_order_t, key: SigningKey) -> bytes:
    """The encoded order; its key and signature are filled in."""
    order.key, order.signature = key.verify_key.encode(), bytes(SIGNATURE_BYTES)
    signed = order.encode()[:-SIGNATURE_BYTES]
    order.signature = key.sign(CONTEXT + signed).signature
    return signed + order.signature


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
        order, refusal = self._authenticate(data)
        if order is None:
            self.refused[refusal] += 1
            return None
        if order.deputy != self.deputy:
            self.num_for_others += 1
            return None
        if order.nonce != self.nonce or order.number <= self.last_number:
            self.refused["stale" if order.nonce != self.nonce else "replayed"] += 1
            return None
        self.last_number = order.number
        self.num_accepted += 1
        return order

    def accept_again(self, data: bytes) -> procman_order_t | None:
        """An order for this deputy that it accepted before its restart, if its key is still trusted."""
        order, _ = self._authenticate(data)
        return order if order is not None and order.deputy == self.deputy else None

    def _authenticate(self, data: bytes) -> tuple[procman_order_t | None, str]:
        """An order signed by a trusted key, or the kind of refusal."""
        if not MIN_BYTES <= len(data) <= MAX_ORDER_BYTES or data[:8] != FINGERPRINT:
            return None, "malformed"
        signed, signature = data[:-SIGNATURE_BYTES], data[-SIGNATURE_BYTES:]
        key = signed[-KEY_BYTES:]
        if not any(signature):
            return None, "unsigned"
        if key not in self._trusted():
            return None, "unknown key"
        try:
            VerifyKey(key).verify(CONTEXT + signed, signature)
        except BadSignatureError:
            return None, "forged"
        order = decode(procman_order_t, data)
        return order, "" if order else "malformed"
