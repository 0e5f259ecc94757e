"""Which base port a run takes, so that a second one on the same machine does not disturb the first."""

from collections.abc import Iterator

from tessera_cli.cluster.keys import key_folder
from tessera_cli.constants import DEFAULT_PORT, FREE_BUS_S, HEARTBEAT
from tessera_cli.errors import RunError
from tessera_cli.lcm_bus import Bus, bus_url, listen
from tessera_cli.membership import run_dir_of
from tessera_cli.runs.locks import RunLock

# From one stack's ports to the next: its buses, and a port for each extractor that there may be.
STEP = 300

NUM_TRIED = 20


class PortLock(RunLock):
    """A network namespace has buses and locks of its own."""

    def __init__(self, port: int, channel_prefix: str) -> None:
        """Raises OSError if another run holds it."""
        super().__init__(f"run-{port}-{channel_prefix}")


def take_free_port(channel_prefix: str) -> tuple[int, PortLock]:
    """The first base port whose bus nobody uses with this prefix, locked. Raises RunError if there is none.

    A run in another network namespace, such as an experiment's, has another bus, but the same folder by its port.
    """
    for port in _candidates():
        try:
            lock = PortLock(port, channel_prefix)
        except OSError:
            continue
        is_used_elsewhere = run_dir_of(key_folder(), bus_url(port), channel_prefix).is_locked()
        if not is_used_elsewhere and _is_silent(port, channel_prefix):
            return port, lock
    raise RunError(
        f"the base ports {DEFAULT_PORT} to {DEFAULT_PORT + STEP * (NUM_TRIED - 1)} are in use: give --port N."
    )


def _candidates() -> Iterator[int]:
    return (DEFAULT_PORT + STEP * number for number in range(NUM_TRIED))


def _is_silent(port: int, channel_prefix: str) -> bool:
    """Every stage sends heartbeats. A port that another program holds for itself is not silent."""
    heard: list[bytes] = []
    try:
        bus = Bus(bus_url(port), "port_finder")
        bus.subscribe(channel_prefix + HEARTBEAT, None, heard.append)
    except RunError:
        return False
    listen([bus], FREE_BUS_S)
    return not heard
