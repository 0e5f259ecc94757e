"""What is heard on a bus: rates and sizes of each channel, and messages that are missing in its streams.

A stream is what one publisher sends on one channel since its start; its messages are numbered without gaps.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import Any

from tessera_cli.message_arrays import decode_arrays
from tessera_cli.messages import type_of

RATE_WINDOW_S = 3.0
# Numbers remembered of a stream, to tell a message that came late from one that came twice.
MAX_MISSING = 10_000


@dataclass
class _Stream:
    next_sequence: int
    missing: set[int] = field(default_factory=set)


@dataclass
class Channel:
    """One channel since it was first heard."""

    name: str
    type_name: str = "?"  # of the last message
    num_messages: int = 0
    num_bytes: int = 0
    num_late: int = 0  # came after being missed: mostly repaired
    last: bytes = b""
    _forgotten: int = 0  # missing messages that are no longer remembered by number
    _streams: dict[tuple[str, int], _Stream] = field(default_factory=dict)
    _recent: deque[tuple[float, int]] = field(default_factory=deque)  # seconds, bytes

    @property
    def num_missing(self) -> int:
        """Messages of its streams, after the first that was heard, that have not come."""
        return self._forgotten + sum(len(stream.missing) for stream in self._streams.values())

    @property
    def publishers(self) -> list[str]:
        return sorted({publisher for publisher, _ in self._streams})

    def add(self, data: bytes, seconds: float) -> None:
        self.num_messages += 1
        self.num_bytes += len(data)
        self.last = data
        self._recent.append((seconds, len(data)))
        message_type = type_of(data)
        self.type_name = message_type.__name__ if message_type else "?"
        message = decode_arrays(message_type, data) if message_type else None
        header = getattr(message, "header", None)
        if header is not None:
            self._count(header)

    def rates(self, seconds: float) -> tuple[float, float]:
        """Messages and bytes in a second, now."""
        while self._recent and self._recent[0][0] < seconds - RATE_WINDOW_S:
            self._recent.popleft()
        return len(self._recent) / RATE_WINDOW_S, sum(size for _, size in self._recent) / RATE_WINDOW_S

    def _count(self, header: Any) -> None:
        sequence = header.sequence
        stream = self._streams.setdefault((header.publisher, header.epoch_us), _Stream(sequence))
        if sequence in stream.missing:
            stream.missing.remove(sequence)
            self.num_late += 1
        elif sequence >= stream.next_sequence:
            num_missing = sequence - stream.next_sequence
            remembered = min(num_missing, MAX_MISSING - len(stream.missing))
            stream.missing.update(range(sequence - remembered, sequence))
            self._forgotten += num_missing - remembered
            stream.next_sequence = sequence + 1


class Traffic:
    """All channels of a bus."""

    def __init__(self) -> None:
        self._channels: dict[str, Channel] = {}

    def add(self, channel: str, data: bytes, seconds: float) -> None:
        self._channels.setdefault(channel, Channel(channel)).add(data, seconds)

    def channels(self) -> list[Channel]:
        """By name."""
        return [self._channels[name] for name in sorted(self._channels)]
