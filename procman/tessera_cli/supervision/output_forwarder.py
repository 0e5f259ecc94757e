"""Forwards what processes write, in whole lines and no more than the bus can carry; their logs hold all of it."""

from dataclasses import dataclass

from nacl.signing import SigningKey

from tessera_cli.constants import MAX_OUTPUT_BYTES, OUTPUT_PERIOD_S, PROCMAN_OUTPUT, TAIL_PIECE_BYTES
from tessera_cli.lcm_bus import Bus
from tessera_cli.messages import procman_output_t
from tessera_cli.supervision.signatures import sign


@dataclass
class _Pending:
    rest: bytes = b""  # an unfinished line
    text: bytes = b""
    num_omitted: int = 0  # lines


class OutputForwarder:
    """Of one deputy, for all its processes."""

    def __init__(self, bus: Bus, deputy: str, key: SigningKey) -> None:
        self._bus, self._deputy, self._key = bus, deputy, key
        self._pending: dict[str, _Pending] = {}
        self._due_at = 0.0

    def add(self, process: str, data: bytes) -> None:
        """Takes what a process wrote."""
        pending = self._pending.setdefault(process, _Pending())
        complete, newline, rest = (pending.rest + data).rpartition(b"\n")
        pending.rest = rest[-MAX_OUTPUT_BYTES:]
        for line in (complete + newline).splitlines(keepends=True):
            if len(pending.text) + len(line) > MAX_OUTPUT_BYTES:
                pending.num_omitted += 1
            else:
                pending.text += line

    def flush(self, now: float) -> None:
        """Sends what is pending once per period. `now`: monotonic seconds."""
        if now < self._due_at:
            return
        self._due_at = now + OUTPUT_PERIOD_S
        for process, pending in self._pending.items():
            if pending.text or pending.num_omitted:
                self._send(process, "", pending.text.decode(errors="replace"), pending.num_omitted)
                pending.text, pending.num_omitted = b"", 0

    def send_tail(self, process: str, order: str, text: str) -> None:
        """The end of a log, asked for by an order; in pieces, of which an empty one is the last."""
        for start in range(0, len(text), TAIL_PIECE_BYTES):
            self._send(process, order, text[start : start + TAIL_PIECE_BYTES], 0)
        self._send(process, order, "", 0)

    def _send(self, process: str, order: str, text: str, num_omitted: int) -> None:
        output = procman_output_t()
        output.header = self._bus.header(PROCMAN_OUTPUT)
        output.deputy, output.process, output.order = self._deputy, process, order
        output.num_omitted, output.text = num_omitted, text.replace("\0", "\N{REPLACEMENT CHARACTER}")
        self._bus.publish(PROCMAN_OUTPUT, sign(output, self._key))
