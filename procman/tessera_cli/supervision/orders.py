"""Signs orders, and tells which of those received are to be obeyed.

  signature = Ed25519(secret key, "tessera procman order" + encoded order without its last 64 bytes)

The last 96 bytes of an encoded order are its key and its signature. They are looked at before anything is decoded.
"""

import secrets
import struct
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from nacl.exceptions import BadSignatureError
from nacl.signing import SigningKey, VerifyKey

from tessera_cli.messages import procman_order_t

CONTEXT = b"tessera procman order"  # a signature of something else is none of an order
KEY_BYTES, SIGNATURE_BYTES, NONCE_BYTES = 32, 64, 16
MIN_BYTES = 8 + KEY_BYTES + SIGNATURE_BYTES
# Wishes for a node with 256 processes are some 100 kB.
MAX_BYTES = 1_000_000
FINGERPRINT = procman_order_t().encode()[:8]
DECODE_ERRORS = (ValueError, struct.error, MemoryError, IndexError, OverflowError, TypeError)
KINDS = ("malformed", "unsigned", "unknown key", "forged", "stale", "replayed")


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


@dataclass
class Gate:
    """Of one deputy, from its start to its end. Counts what it does not let through, by kind."""

    deputy: str
    trusted: Callable[[], Iterable[bytes]]  # the public keys obeyed now

    def __post_init__(self):
        self.nonce = draw_nonce()
        self.last_number = 0
        self.num_passed = 0
        self.num_for_others = 0
        self.refused: Counter[str] = Counter()

    def check(self, data: bytes) -> procman_order_t | None:
        """The order if it is to be obeyed. It is passed once: the same bytes are a replay ever after."""
        order, kind = self._authenticate(data)
        if order is not None and order.deputy != self.deputy:
            self.num_for_others += 1
            return None
        if order is not None and order.nonce != self.nonce:
            kind = "stale"
        elif order is not None and order.number <= self.last_number:
            kind = "replayed"
        if kind:
            self.refused[kind] += 1
            return None
        self.last_number = order.number
        self.num_passed += 1
        return order

    def recognize(self, data: bytes) -> procman_order_t | None:
        """An order for this deputy that was let through in an earlier life, if its key is still trusted."""
        order, _ = self._authenticate(data)
        return order if order is not None and order.deputy == self.deputy else None

    def _authenticate(self, data: bytes) -> tuple[procman_order_t | None, str]:
        """An order that a trusted key signed, or why it is none."""
        if not MIN_BYTES <= len(data) <= MAX_BYTES or data[:8] != FINGERPRINT:
            return None, "malformed"
        signed, signature = data[:-SIGNATURE_BYTES], data[-SIGNATURE_BYTES:]
        key = signed[-KEY_BYTES:]
        if not any(signature):
            return None, "unsigned"
        if key not in self.trusted():
            return None, "unknown key"
        try:
            VerifyKey(key).verify(CONTEXT + signed, signature)
        except BadSignatureError:
            return None, "forged"
        order = decode_order(data)
        return order, "" if order else "malformed"


def decode_order(data: bytes) -> procman_order_t | None:
    try:
        return procman_order_t.decode(data)
    except DECODE_ERRORS:
        return None
