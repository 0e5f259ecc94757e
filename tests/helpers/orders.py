"""Good orders, and all kinds of bad ones."""

import random
from typing import Any

from nacl.signing import SigningKey

from tessera_cli.messages import procman_order_t, procman_wish_t
from tessera_cli.supervision.orders import OrderVerifier
from tessera_cli.supervision.signatures import KEY_BYTES, SIGNATURE_BYTES, sign

KEY = SigningKey(bytes(range(32)))
OTHER_KEY = SigningKey(bytes(range(1, 33)))


def make_verifier(deputy: str = "node1") -> OrderVerifier:
    return OrderVerifier(deputy, lambda: [KEY.verify_key.encode()])


def make_order(verifier: OrderVerifier, number: int = 1, **changes: Any) -> procman_order_t:
    order = procman_order_t()
    order.deputy, order.nonce, order.number = verifier.deputy, verifier.nonce, number
    order.order, order.action = "an order", procman_order_t.RUN
    wish = procman_wish_t()
    wish.name = wish.command = "camera"
    order.num_wishes, order.wishes = 1, [wish]
    for name, value in changes.items():
        setattr(order, name, value)
    return order


def bad_order(verifier: OrderVerifier, obeyed: list[bytes], randomness: random.Random) -> bytes:
    """One of the ways to be no order, by turns."""
    good = sign(make_order(verifier, number=1000 + randomness.randrange(1000)), KEY)
    match randomness.randrange(8):
        case 0:  # forged: another's words under a trusted key
            return good[:-SIGNATURE_BYTES] + randomness.randbytes(SIGNATURE_BYTES)
        case 1:  # replayed
            return randomness.choice(obeyed)
        case 2:  # unsigned
            return good[:-SIGNATURE_BYTES] + bytes(SIGNATURE_BYTES)
        case 3:  # truncated
            return good[: randomness.randrange(len(good))]
        case 4:  # signed by a stranger
            return sign(make_order(verifier, number=5000), OTHER_KEY)
        case 5:  # a stranger's signature beside a trusted key
            stranger = sign(make_order(verifier, number=5000), OTHER_KEY)
            return stranger[: -SIGNATURE_BYTES - KEY_BYTES] + KEY.verify_key.encode() + stranger[-SIGNATURE_BYTES:]
        case 6:  # of an earlier life
            return sign(make_order(verifier, number=5000, nonce=randomness.randbytes(16)), KEY)
    return randomness.randbytes(randomness.randrange(2000))  # noise
