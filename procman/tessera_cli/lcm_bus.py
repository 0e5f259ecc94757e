"""The only module that uses LCM: buses, their URLs, and recorded logs."""

import os
import select
import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import lcm

from tessera_cli.constants import (
    MAX_MESSAGES_PER_TURN,
    MULTICAST_GROUP,
    PORT_OFFSETS,
    QUEUE_CAPACITY,
    RECEIVE_BUFFER_BYTES,
)
from tessera_cli.errors import RunError
from tessera_cli.messages import decode, header_t

RECEIVE_BUFFER_LIMIT = Path("/proc/sys/net/core/rmem_max")


def bus_url(port: int, time_to_live: int = 0) -> str:
    """`time_to_live` 0: multicast that stays on this machine."""
    return f"udpm://{MULTICAST_GROUP}:{port}?ttl={time_to_live}"


def is_on_lan(arguments: Namespace) -> bool:
    """Whether messages leave this machine: --lan, or TESSERA_LAN=1 in the environment."""
    return arguments.lan or os.environ.get("TESSERA_LAN", "") == "1"


def procman_url(arguments: Namespace) -> str:
    """The bus between sheriffs and deputies."""
    return bus_url(arguments.port + PORT_OFFSETS["procman"], int(is_on_lan(arguments)))


class Bus:
    """One LCM instance. `publisher` names this process in the headers of what it sends."""

    def __init__(self, url: str, publisher: str, hears_images: bool = False) -> None:
        """`hears_images`, or maps: bursts need a large receive buffer. Raises RunError if the bus can't be opened."""
        self.url = url
        self._publisher = publisher
        self._epoch_us = int(time.time() * 1e6)
        self._sequences: dict[str, int] = {}
        try:
            self._lcm = lcm.LCM(f"{url}&recv_buf_size={_granted_buffer_bytes()}" if hears_images else url)
        except RuntimeError as error:
            raise RunError(_explain(url, str(error))) from error

    def subscribe(self, channel: str, message_type: Any, handler: Callable[[Any], None]) -> Any:
        """`handler` gets decoded messages, or bytes where `message_type` is None. Invalid messages are ignored.

        Returns the subscription, for `unsubscribe`.
        """

        def on_message(_channel: str, data: bytes) -> None:
            message = data if message_type is None else decode(message_type, data)
            if message is not None:
                handler(message)

        return self._subscribe(channel, on_message)

    def subscribe_all(self, handler: Callable[[str, bytes], None]) -> None:
        """`handler` gets channel and bytes of every message but those by which LCM tests itself."""
        self._subscribe("(?!LCM_SELF_TEST).*", handler)

    def _subscribe(self, pattern: str, handler: Callable[[str, bytes], None]) -> Any:
        # None: another program holds the port exclusively, or LCM's self-test received nothing.
        subscription = self._lcm.subscribe(pattern, handler)
        if subscription is None:
            raise RunError(_explain(self.url, "nothing can be received"))
        subscription.set_queue_capacity(QUEUE_CAPACITY)
        return subscription

    def unsubscribe(self, subscription: Any) -> None:
        self._lcm.unsubscribe(subscription)

    def fileno(self) -> int:
        return self._lcm.fileno()

    def handle_waiting(self) -> None:
        """Handles messages that have arrived, without waiting for more."""
        for _ in range(MAX_MESSAGES_PER_TURN):
            if self._lcm.handle_timeout(0) <= 0:
                return

    def header(self, channel: str) -> header_t:
        """The header of the next message that this process sends on `channel`."""
        header = header_t()
        header.publisher, header.epoch_us, header.utime = self._publisher, self._epoch_us, int(time.time() * 1e6)
        header.sequence = self._sequences.get(channel, 0)
        header.part, header.num_parts = 0, 1
        self._sequences[channel] = header.sequence + 1
        return header

    def publish(self, channel: str, data: bytes) -> None:
        """The message is lost if the link is down, as on any network: whoever needs an answer repeats it."""
        try:
            self._lcm.publish(channel, data)
        except (OSError, RuntimeError):
            pass


def listen(buses: Sequence[Bus], seconds: float) -> None:
    """Handles what arrives within this time. (LCM's own waiting would turn a signal into an error.)"""
    deadline = time.monotonic() + seconds
    while (left_s := deadline - time.monotonic()) > 0:
        for bus in select.select(buses, [], [], left_s)[0]:
            bus.handle_waiting()


def log_events(path: Path) -> Iterator[tuple[str, bytes]]:
    """Channel and data of all events of a recorded log."""
    log = lcm.EventLog(str(path), "r")
    try:
        yield from ((event.channel, event.data) for event in log)
    finally:
        log.close()


def log_messages(path: Path, channel: str) -> Iterator[bytes]:
    """The data of all events of a recorded log on one channel."""
    yield from (data for name, data in log_events(path) if name == channel)


def _granted_buffer_bytes() -> int:
    """LCM complains if it asks for more than the kernel grants."""
    try:
        return min(RECEIVE_BUFFER_BYTES, int(RECEIVE_BUFFER_LIMIT.read_text()))
    except (OSError, ValueError):
        return RECEIVE_BUFFER_BYTES


def _explain(url: str, reason: str) -> str:
    return (
        f"the bus {url} can't be opened ({reason}). Does another program hold its port (ss -ulpn shows which; "
        "--port N selects others)? Is multicast possible? Try: sudo ip link set lo multicast on; "
        "sudo ip route add 224.0.0.0/4 dev lo (with --lan: dev the network's device)"
    )
