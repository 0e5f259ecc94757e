"""Signs what sheriffs and deputies tell each other, and verifies it before anything of it is decoded.

  signature = Ed25519(secret key, context + encoded message without its last 64 bytes)

The last 96 bytes of each encoded message are the public key and the signature. The context names the kind of message,
so that the signature of anything else is not valid for it.
"""

from collections.abc import Container
from typing import Any

from nacl.exceptions import BadSignatureError
from nacl.signing import SigningKey, VerifyKey

from tessera_cli.constants import MAX_ORDER_BYTES
from tessera_cli.messages import decode, procman_order_t, procman_output_t, procman_status_t, receive

KEY_BYTES, SIGNATURE_BYTES = 32, 64
MIN_BYTES = 8 + KEY_BYTES + SIGNATURE_BYTES
CONTEXTS = {
    procman_order_t: b"tessera procman order",
    procman_status_t: b"tessera procman status",
    procman_output_t: b"tessera procman output",
}


def sign(message: Any, key: SigningKey) -> bytes:
    """The encoded message; its key and signature are filled in."""
    message.key, message.signature = key.verify_key.encode(), bytes(SIGNATURE_BYTES)
    signed = message.encode()[:-SIGNATURE_BYTES]
    message.signature = key.sign(CONTEXTS[type(message)] + signed).signature
    return signed + message.signature


def authenticate(message_type: Any, data: bytes, trusted: Container[bytes]) -> tuple[Any | None, str]:
    """A message of this type that a trusted key has signed, or the kind of refusal."""
    if not MIN_BYTES <= len(data) <= MAX_ORDER_BYTES or data[:8] != message_type().encode()[:8]:
        return None, "malformed"
    signed, signature = data[:-SIGNATURE_BYTES], data[-SIGNATURE_BYTES:]
    key = signed[-KEY_BYTES:]
    if not any(signature):
        return None, "unsigned"
    if key not in trusted:
        return None, "unknown key"
    try:
        VerifyKey(key).verify(CONTEXTS[message_type] + signed, signature)
    except BadSignatureError:
        return None, "forged"
    # What deputies say is shown to people; what an order says is done as it stands.
    message = (decode if message_type is procman_order_t else receive)(message_type, data)
    return message, "" if message else "malformed"
