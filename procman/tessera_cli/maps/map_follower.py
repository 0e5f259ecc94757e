"""How a listener that comes at any time follows the map of a running stack, as modules/map/map_follower.h does.

The last delta that it has tells what it lacks: it asks the mapper (MAP_REQUEST) for the deltas after that, and gets
these, or the whole map page by page. It knows no bus: messages are passed in, and what is to be asked for comes out.
"""

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Any

from tessera_cli.maps.map_replica import MapError, MapReplica

# Deltas kept behind a gap; more are dropped, and asked for when the gap is closed.
MAX_WAITING = 256
# Deltas and pages that the mapper sends for one request (modules/map/map_exchange.h).
MAX_DELTAS, MAX_PAGES = 16, 8


@dataclass(frozen=True)
class Request:
    """The content of a map_request_t."""

    next_delta: int = -1
    snapshot: int = -1
    page: int = 0

    def is_answered_with(self, asked: "Request") -> bool:
        """Whether the answer to `asked` holds this too: while it comes in, the next part of it is missing each time."""
        if self == asked:
            return True
        if self.snapshot >= 0 or asked.snapshot >= 0:
            return self.snapshot == asked.snapshot and 0 < self.page - asked.page < MAX_PAGES
        return 0 < self.next_delta - asked.next_delta < MAX_DELTAS


class PartJoiner:
    """Collects the messages of values that travel in parts. Values whose parts were lost are forgotten."""

    def __init__(self, max_values: int = MAX_WAITING) -> None:
        self._parts: dict[Hashable, dict[int, Any]] = {}
        self._max_values = max_values

    def add(self, key: Hashable, message: Any) -> list[Any] | None:
        """All parts of the value in order, when this was the last one that was missing."""
        parts = self._parts.setdefault((key, message.header.publisher, message.header.epoch_us), {})
        parts[message.header.part] = message
        if len(parts) < message.header.num_parts:
            while len(self._parts) > self._max_values:
                del self._parts[next(iter(self._parts))]
            return None
        del self._parts[(key, message.header.publisher, message.header.epoch_us)]
        return [parts[number] for number in sorted(parts)]


@dataclass
class _Snapshot:
    """Pages that have come so far."""

    number: int
    num_pages: int
    next_page: int = 0
    replica: MapReplica = field(default_factory=MapReplica)


class MapFollower:
    """`replica` is the map after delta `next_delta` - 1."""

    def __init__(self) -> None:
        self.replica = MapReplica()
        self.next_delta = 0
        self._lacks_start = True  # there may be a map already
        self._joiner = PartJoiner()
        self._waiting: dict[int, list[Any]] = {}  # whole deltas that came before their turn
        self._snapshot: _Snapshot | None = None

    def on_delta(self, message: Any) -> bool:
        """A map_delta_t. Returns whether the replica changed."""
        parts = self._joiner.add(("delta", message.number), message)
        if parts is None or message.number < self.next_delta:
            return False
        self._waiting.setdefault(message.number, parts)
        if len(self._waiting) > MAX_WAITING:  # not the first: the one that closes the gap must always find room
            del self._waiting[max(self._waiting)]
        return self._apply_waiting()

    def on_page(self, message: Any) -> bool:
        """A map_snapshot_t. Returns whether the replica changed."""
        parts = self._joiner.add(("page", message.number, message.page), message)
        if parts is None or self.request() is None:
            return False
        if message.page == 0 and (self._snapshot is None or message.number > self._snapshot.number):
            if message.number < self.next_delta:
                return False
            self._snapshot = _Snapshot(message.number, message.num_pages)
        snapshot = self._snapshot
        if snapshot is None or (message.number, message.page) != (snapshot.number, snapshot.next_page):
            return False
        if not self._apply(snapshot.replica, parts):
            return False
        snapshot.next_page += 1
        if snapshot.next_page < snapshot.num_pages:
            return False
        self._take(snapshot)
        return True

    def request(self) -> Request | None:
        """What to ask the mapper for; None: nothing is known to be missing."""
        if self._snapshot is not None:
            return Request(self.next_delta, self._snapshot.number, self._snapshot.next_page)
        if self._lacks_start or any(number > self.next_delta for number in self._waiting):
            return Request(self.next_delta)
        return None

    def _take(self, snapshot: _Snapshot) -> None:
        snapshot.replica.removed = self.replica.removed
        self.replica, self.next_delta = snapshot.replica, snapshot.number + 1
        self._snapshot, self._lacks_start = None, False
        self._waiting = {number: parts for number, parts in self._waiting.items() if number >= self.next_delta}
        self._apply_waiting()

    def _apply_waiting(self) -> bool:
        has_changed = False
        while (parts := self._waiting.pop(self.next_delta, None)) is not None:
            self._snapshot, self._lacks_start = None, False
            self.next_delta += 1
            has_changed |= self._apply(self.replica, parts)
        return has_changed

    def _apply(self, replica: MapReplica, parts: list[Any]) -> bool:
        """Where a change does not fit, the whole map is asked for anew."""
        try:
            for part in parts:
                replica.apply(part.change)
        except MapError:
            self.replica, self.next_delta = MapReplica(), 0
            self._lacks_start, self._snapshot = True, None
            self._waiting.clear()
            return False
        return True
