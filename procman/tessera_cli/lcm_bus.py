"""The bus between sheriffs and deputies, and how any bus is listened to without blocking."""

import os
import struct
import time
from argparse import Namespace
from collections.abc import Callable

import lcm

from tessera_cli.errors import RunFailed
from tessera_cli.messages import header_t
from tessera_cli.settings import GROUP

PORT_OFFSET = 3  # from the base port: 7667 -> 7670
QUEUE_CAPACITY = 1000
ORDER, STATUS, OUTPUT = "PROCMAN_ORDER", "PROCMAN_STATUS", "PROCMAN_OUTPUT"
DECODE_ERRORS = (ValueError, struct.error, MemoryError, IndexError, OverflowError, TypeError)
# Messages handled before the loop looks at its processes again.
MAX_MESSAGES_A_TURN = 200


def ttl_of(arguments: Namespace) -> int:
    """1 with --lan or TESSERA_LAN=1, else 0: nothing leaves this machine."""
    return int(arguments.lan or os.environ.get("TESSERA_LAN", "") == "1")


def procman_url(arguments: Namespace) -> str:
    return f"udpm://{GROUP}:{arguments.port + PORT_OFFSET}?ttl={ttl_of(arguments)}"


class Bus:
    """One LCM instance."""

    def __init__(self, url: str, publisher: str) -> None:
        self.url = url
        self._publisher = publisher
        self._epoch_us = int(time.time() * 1e6)
        self._sequences: dict[str, int] = {}
        try:
            self._lcm = lcm.LCM(url)
        except RuntimeError as error:
            raise RunFailed(_explain(url, error)) from error

    def subscribe(self, channel: str, message_type, handler: Callable) -> None:
        """`handler` gets decoded messages, or bytes where `message_type` is None. What makes no sense is left out."""

        def on_message(_channel: str, data: bytes) -> None:
            try:
                message = data if message_type is None else message_type.decode(data)
            except DECODE_ERRORS:
                return
            handler(message)

        # None: the port is taken by a program that shares it with nobody, or LCM's self-test heard nothing.
        subscription = self._lcm.subscribe(channel, on_message)
        if subscription is None:
            raise RunFailed(_explain(self.url, "nothing can be received"))
        subscription.set_queue_capacity(QUEUE_CAPACITY)

    def fileno(self) -> int:
        return self._lcm.fileno()

    def handle_waiting(self) -> None:
        for _ in range(MAX_MESSAGES_A_TURN):
            if self._lcm.handle_timeout(0) <= 0:
                return

    def header(self, channel: str) -> header_t:
        header = header_t()
        header.publisher, header.epoch_us, header.utime = self._publisher, self._epoch_us, int(time.time() * 1e6)
        header.sequence = self._sequences.get(channel, 0)
        header.part, header.num_parts = 0, 1
        self._sequences[channel] = header.sequence + 1
        return header

    def publish(self, channel: str, data: bytes) -> None:
        """A link that is down loses it, as any network may; who needs an answer asks again."""
        try:
            self._lcm.publish(channel, data)
        except (OSError, RuntimeError):
            pass


def _explain(url: str, why: object) -> str:
    return (
        f"the bus {url} can't be opened ({why}). Does another program hold its port (ss -ulpn shows which; --port N takes others)? "
        "Is multicast possible? Try: sudo ip link set lo multicast on; sudo ip route add 224.0.0.0/4 dev lo (with --lan: dev the network's device)"
    )
