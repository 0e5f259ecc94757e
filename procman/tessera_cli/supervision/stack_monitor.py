"""Listens to STATUS and POSE of a stack that this command has started, and notices other stacks on the same bus."""

import os
import time
from collections.abc import Callable
from pathlib import Path

from tessera_cli.constants import FREE_BUS_S, HEARTBEAT, POSE, STATUS
from tessera_cli.lcm_bus import Bus, listen
from tessera_cli.messages import heartbeat_t, pose_t, stage_status_t
from tessera_cli.supervision.progress import STAGE_STATES, Progress, is_tracker_pose, to_report


def hear_heartbeats(url: str, channel_prefix: str) -> list[heartbeat_t]:
    """Those of all stages on this bus, whoever they belong to: each sends ten a second."""
    heard: list[heartbeat_t] = []
    bus = Bus(url, "run_monitor")
    bus.subscribe(channel_prefix + HEARTBEAT, heartbeat_t, heard.append)
    listen([bus], FREE_BUS_S)
    return heard


def is_of_this_machine(heartbeat: heartbeat_t) -> bool:
    """Whether it names a stage that lives here. Anybody can send a heartbeat; this takes a process besides."""
    if heartbeat.host != os.uname().nodename:
        return False
    try:
        return Path(f"/proc/{heartbeat.pid}/comm").read_text().startswith("tessera-")
    except OSError:
        return False


class StackMonitor:
    """Keeps the Progress of a run."""

    def __init__(
        self, url: str, channel_prefix: str, owns_pid: Callable[[int], bool], secret: bytes | None = None
    ) -> None:
        """`owns_pid`: whether a process of this machine belongs to our stack; reports of others are not ours.

        `secret`: of the run; what does not come from its members is passed over.
        Raises RunError if the bus can't be opened.
        """
        self.progress = Progress()
        self.others_heard_at = 0.0  # monotonic seconds: the last status of a process that is not ours
        self._owns_pid = owns_pid
        self._host = os.uname().nodename
        self._bus = Bus(url, "run_monitor", hears_images=True)  # features and the map pass by on the main bus
        self._bus.subscribe(channel_prefix + STATUS, stage_status_t, self._on_status, secret)
        self._bus.subscribe(channel_prefix + POSE, pose_t, self._on_pose, secret)

    @property
    def num_strangers(self) -> int:
        """Messages that this process has passed over."""
        return self._bus.num_strangers

    def listen(self, seconds: float) -> None:
        """Handles what arrives within this time."""
        listen([self._bus], seconds)

    def _on_status(self, message: stage_status_t) -> None:
        if message.state not in STAGE_STATES:
            return
        if not self._owns_pid(message.pid):
            self.others_heard_at = time.monotonic()
        elif message.host == self._host:
            self.progress.add_report(to_report(message))

    def _on_pose(self, message: pose_t) -> None:
        if is_tracker_pose(message):
            self.progress.add_pose(message)
