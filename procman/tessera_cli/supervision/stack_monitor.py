"""Listens to STATUS and POSE of a stack that this command has started, and notices other stacks on the same bus."""

import os
import time
from collections.abc import Callable

from tessera_cli.constants import FREE_BUS_S, HEARTBEAT, POSE, STATUS
from tessera_cli.lcm_bus import Bus, listen
from tessera_cli.messages import decode, heartbeat_t, pose_t, stage_status_t
from tessera_cli.supervision.progress import STAGE_STATES, Progress, is_tracker_pose, to_report


class StackMonitor:
    """Keeps the Progress of a run."""

    def __init__(
        self, url: str, channel_prefix: str, owns_pid: Callable[[int], bool], shares_extractors: bool = False
    ) -> None:
        """`owns_pid`: whether a process of this machine belongs to our stack; reports of others are not ours.

        `shares_extractors`: extractors on this bus belong to a pool, not to another stack.
        Raises RunError if the bus can't be opened.
        """
        self.progress = Progress()
        self.foreign = ""  # a living process that was on this bus before us
        self.others_heard_at = 0.0  # monotonic seconds: the last status of a process that is not ours
        self._began_us = int(time.time() * 1e6)
        self._owns_pid = owns_pid
        self._shares_extractors = shares_extractors
        self._channel_prefix = channel_prefix
        self._host = os.uname().nodename
        self._bus = Bus(url, "run_monitor")
        self._bus.subscribe(channel_prefix + STATUS, stage_status_t, self._on_status)
        self._bus.subscribe(channel_prefix + POSE, pose_t, self._on_pose)

    def listen(self, seconds: float) -> None:
        """Handles what arrives within this time."""
        listen([self._bus], seconds)

    def is_free(self) -> bool:
        """Whether no stack uses the bus. Every stage sends heartbeats, ten a second."""
        publishers: list[str] = []

        def on_heartbeat(data: bytes) -> None:
            heartbeat = decode(heartbeat_t, data)
            publishers.append(heartbeat.header.publisher if heartbeat else "")  # "": a stack of another version

        subscription = self._bus.subscribe(self._channel_prefix + HEARTBEAT, None, on_heartbeat)
        self.listen(FREE_BUS_S)
        self._bus.unsubscribe(subscription)
        return all(self._is_of_pool(name) for name in publishers) and not self.foreign

    def _is_of_pool(self, name: str) -> bool:
        return self._shares_extractors and name.startswith("extractor")

    def _on_status(self, message: stage_status_t) -> None:
        if message.state not in STAGE_STATES:
            return
        is_ours = self._owns_pid(message.pid)
        if not is_ours:
            self.others_heard_at = time.monotonic()
        if message.host != self._host:
            return
        if is_ours:
            self.progress.add_report(to_report(message))
        elif self._was_here_before(message) and not self._is_of_pool(message.name):
            self.foreign = f"{message.name}, process {message.pid}"

    def _was_here_before(self, message: stage_status_t) -> bool:
        return message.stage_epoch_us < self._began_us and os.path.exists(f"/proc/{message.pid}")

    def _on_pose(self, message: pose_t) -> None:
        if is_tracker_pose(message):
            self.progress.add_pose(message)
