"""The map of a run: map.tessera, an LCM log of one MAP_FILE message and the pages of a snapshot."""

from collections.abc import Iterator
from pathlib import Path

from tessera_cli.errors import UserError
from tessera_cli.lcm_bus import log_events
from tessera_cli.maps.map_replica import MapError, MapReplica
from tessera_cli.message_arrays import decode_arrays
from tessera_cli.messages import map_file_t, map_snapshot_t


def read_map_file(path: Path) -> MapReplica:
    """Raises UserError if there is no such file, or if it is damaged or of another version."""
    if not path.is_file():
        raise UserError(f"{path}: there is no such map; a run writes it when it ends.")
    events = _events(path)
    channel, data = next(events, ("", b""))
    header = decode_arrays(map_file_t, data) if channel == "MAP_FILE" else None
    if header is None:
        raise UserError(f"{path}: is no map, or one of another version of Tessera; make the map again with this one.")
    replica, num_pages, page = MapReplica(), 0, None
    try:
        for _channel, data in events:
            page = decode_arrays(map_snapshot_t, data)
            if page is None or page.num_pages != header.num_pages:
                raise UserError(f"{path}: is damaged: copy it again, or make the map again.")
            replica.apply(page.change)
            num_pages += page.header.part == page.header.num_parts - 1
    except MapError as error:
        raise UserError(f"{path}: is damaged: {error}.") from error
    if num_pages != header.num_pages or len(replica.keyframes) != header.num_keyframes:
        raise UserError(f"{path}: is cut off: copy it again, or make the map again.")
    return replica


def _events(path: Path) -> Iterator[tuple[str, bytes]]:
    try:
        yield from log_events(path)
    except OSError as error:
        raise UserError(f"{path}: can't be read ({error.strerror}).") from error
