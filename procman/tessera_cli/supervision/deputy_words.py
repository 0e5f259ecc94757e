"""Which of the words of deputies count: those that a trusted key has signed, and that are newer than the last ones."""

from collections import Counter
from collections.abc import Callable, Container
from typing import Any

from tessera_cli.messages import procman_status_t
from tessera_cli.supervision.signatures import KEY_BYTES, SIGNATURE_BYTES, authenticate

# Deputies with unknown keys that are remembered, to be named.
MAX_UNKNOWN = 20


class DeputyWords:
    """Of all deputies, as one listener hears them."""

    def __init__(self, trusted: Callable[[], Container[bytes]]) -> None:
        """`trusted`: returns the public keys that are believed at this moment."""
        self._trusted = trusted
        self._newest: dict[tuple[Any, str], tuple[int, int]] = {}  # by type and deputy: epoch and sequence number
        self.refused: Counter[str] = Counter()
        self.unknown: dict[str, bytes] = {}  # deputies whose keys are not trusted, as they say

    def accept(self, message_type: Any, data: bytes) -> Any | None:
        """The message if it counts."""
        trusted = self._trusted()
        message, refusal = authenticate(message_type, data, trusted)
        if message is None:
            self.refused[refusal] += 1
            if refusal == "unknown key" and message_type is procman_status_t and len(self.unknown) < MAX_UNKNOWN:
                self._note_unknown(data)
            return None
        number, source = (message.header.epoch_us, message.header.sequence), (message_type, message.deputy)
        if number <= self._newest.get(source, (0, -1)):
            self.refused["replayed"] += 1
            return None
        self._newest[source] = number
        return message

    def _note_unknown(self, data: bytes) -> None:
        key = data[-SIGNATURE_BYTES - KEY_BYTES : -SIGNATURE_BYTES]
        status, _ = authenticate(procman_status_t, data, {key})
        if status is not None:
            self.unknown[status.deputy] = key
