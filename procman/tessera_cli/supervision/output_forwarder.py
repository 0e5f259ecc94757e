"""Forwards what processes write as whole lines, no more than the bus can take; all of it is in their logs."""

from dataclasses import dataclass

from tessera_cli.lcm_bus import OUTPUT, Bus
from tessera_cli.messages import procman_output_t

PERIOD_S = 0.2
# Of one process in one period: 10 kB/s, so that a chatterbox leaves the network to images.
MAX_BYTES = 2000
# A tail travels in pieces that fit one packet of any network.
TAIL_BYTES = 1000


@dataclass
class _Pending:
    rest: bytes = b""  # an unfinished line
    text: bytes = b""
    num_omitted: int = 0


class OutputForwarder:
    def __init__(self, bus: Bus, deputy: str) -> None:
        self._bus, self._deputy = bus, deputy
        self._pending: dict[str, _Pending] = {}
        self._due_at = 0.0

    def add(self, process: str, data: bytes) -> None:
        pending = self._pending.setdefault(process, _Pending())
        whole, newline, rest = (pending.rest + data).rpartition(b"\n")
        pending.rest = rest[-MAX_BYTES:]
        lines = (whole + newline).splitlines(keepends=True)
        for line in lines:
            if len(pending.text) + len(line) > MAX_BYTES:
                pending.num_omitted += 1
            else:
                pending.text += line

    def flush(self, now: float) -> None:
        """`now`: monotonic seconds."""
        if now < self._due_at:
            return
        self._due_at = now + PERIOD_S
        for process, pending in self._pending.items():
            if pending.text or pending.num_omitted:
                self._send(process, "", pending.text.decode(errors="replace"), pending.num_omitted)
                pending.text, pending.num_omitted = b"", 0

    def send_tail(self, process: str, order: str, text: str) -> None:
        """In pieces; an empty one says that it was the last."""
        for start in range(0, len(text), TAIL_BYTES):
            self._send(process, order, text[start : start + TAIL_BYTES], 0)
        self._send(process, order, "", 0)

    def _send(self, process: str, order: str, text: str, num_omitted: int) -> None:
        output = procman_output_t()
        output.header = self._bus.header(OUTPUT)
        output.deputy, output.process, output.order = self._deputy, process, order
        output.num_omitted, output.text = num_omitted, text.replace("\0", "\N{REPLACEMENT CHARACTER}")
        self._bus.publish(OUTPUT, output.encode())
