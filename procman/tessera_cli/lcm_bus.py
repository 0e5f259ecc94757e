"""The only module that uses LCM: buses, their URLs, and recorded logs."""

import os
import select
import time
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lcm

from tessera_cli.constants import (
    LAN_GROUPS,
    LAN_QUEUE_CAPACITY,
    MAX_MESSAGES_PER_TURN,
    MULTICAST_GROUP,
    PORT_OFFSETS,
    QUEUE_CAPACITY,
    RECEIVE_BUFFER_BYTES,
)
from tessera_cli.errors import RunError, UserError
from tessera_cli.files import replacing
from tessera_cli.membership import is_of_member
from tessera_cli.messages import header_t, receive

LOG_SYNC = bytes.fromhex("eda1da01")  # the first bytes of each event in a log

RECEIVE_BUFFER_LIMIT = Path("/proc/sys/net/core/rmem_max")


def bus_url(port: int, time_to_live: int = 0, group: str = MULTICAST_GROUP) -> str:
    """`time_to_live` 0: multicast that stays on this machine."""
    return f"udpm://{group}:{port}?ttl={time_to_live}"


def stack_bus_url(bus: str, port: int, on_lan: bool) -> str:
    """Of a bus of PORT_OFFSETS. `port`: the base port of all."""
    if not on_lan:
        return bus_url(port + PORT_OFFSETS[bus])
    return bus_url(port + PORT_OFFSETS[bus], 1, LAN_GROUPS.get(bus, MULTICAST_GROUP))


def is_on_lan(arguments: Namespace) -> bool:
    """Whether messages leave this machine: --lan, or TESSERA_LAN=1 in the environment."""
    return arguments.lan or os.environ.get("TESSERA_LAN", "") == "1"


def procman_url(arguments: Namespace) -> str:
    """The bus between sheriffs and deputies."""
    return bus_url(arguments.port + PORT_OFFSETS["procman"], int(is_on_lan(arguments)))


class Bus:
    """One LCM instance. `publisher` names this process in the headers of what it sends."""

    def __init__(self, url: str, publisher: str, epoch_us: int | None = None, hears_images: bool = False) -> None:
        """`epoch_us`: of this publisher's life, more than all earlier ones had; None: the time.

        `hears_images`, or maps: bursts need a large receive buffer. Raises RunError if the bus can't be opened.
        """
        self.url = url
        self._publisher = publisher
        self._epoch_us = epoch_us or int(time.time() * 1e6)
        self._sequences: dict[str, int] = {}
        self.num_strangers = 0  # messages passed over
        try:
            self._lcm = lcm.LCM(f"{url}&recv_buf_size={_granted_buffer_bytes()}" if hears_images else url)
        except RuntimeError as error:
            raise RunError(_explain(url, str(error))) from error

    def subscribe(
        self, channel: str, message_type: Any, handler: Callable[[Any], None], secret: bytes | None = None
    ) -> Any:
        """`handler` gets decoded messages, or bytes where `message_type` is None. Invalid messages are ignored.

        `secret`: of a run; then messages that no member of it sent are passed over, as are those that are not newer
        than what their publisher sent before. Returns the subscription, for `unsubscribe`.
        """
        newest: dict[str, tuple[int, int]] = {}  # by publisher: epoch and sequence number

        def on_message(_channel: str, data: bytes) -> None:
            if secret is not None and not is_of_member(channel, data, secret):
                self.num_strangers += 1
                return
            message: Any = data if message_type is None else receive(message_type, data)
            if message is None:
                return
            if secret is not None and message_type is not None:
                header = message.header
                number = (header.epoch_us, header.sequence)
                if number <= newest.get(header.publisher, (0, -1)):
                    return
                newest[header.publisher] = number
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
        subscription.set_queue_capacity(QUEUE_CAPACITY if self.url.endswith("?ttl=0") else LAN_QUEUE_CAPACITY)
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


@dataclass(frozen=True)
class LoggedEvent:
    """One message in a log."""

    time_us: int  # since 1970, or of the recorder's choice
    channel: str
    data: bytes


def read_log(path: Path) -> Iterator[LoggedEvent]:
    """All events of a log. Raises UserError if it is none, or behind the last event that is whole."""
    with open(path, "rb") as file:
        if file.read(4) != LOG_SYNC:
            raise UserError(f"{path} is no LCM log.")
    log = lcm.EventLog(str(path), "r")
    try:
        read_until = 0
        for event in log:
            yield LoggedEvent(event.timestamp, event.channel, event.data)
            read_until = log.tell()
        if read_until < log.size():
            raise UserError(f"{path} is cut off or damaged behind byte {read_until:,} of {log.size():,}.")
    finally:
        log.close()


def write_log(path: Path, events: Iterable[LoggedEvent]) -> int:
    """Writes the log whole or not at all. Returns the number of events."""
    num_events = 0
    with replacing(path) as written:
        log = lcm.EventLog(str(written), "w", overwrite=True)
        try:
            for event in events:
                log.write_event(event.time_us, event.channel, event.data)
                num_events += 1
        finally:
            log.close()
    return num_events


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
