"""Listens to STATUS and POSE on the main bus, and keeps the Progress of a run."""

import os
import select
import struct
import time
from collections.abc import Callable

import lcm

from tessera_cli.errors import RunFailed
from tessera_cli.messages import heartbeat_t, pose_t, stage_status_t
from tessera_cli.supervision.progress import FAILED, STARTING, Progress, StageReport

TRACKING_STATES = {pose_t.INITIALIZING: "initializing", pose_t.TRACKED: "tracked", pose_t.LOST: "lost"}
# Poses come in bursts, and LCM's default of 30 would drop some.
QUEUE_CAPACITY = 1000
# A bus without a heartbeat for this long is free.
FREE_BUS_MS = 250
# What decoding raises on bytes that make no sense. The stages count them; for a display they are nothing.
DECODE_ERRORS = (ValueError, struct.error, MemoryError, IndexError, OverflowError)


class BusListener:
    """`owns_pid` tells whether a process of this machine belongs to our stack: others' reports are not ours.
    `shares_extractors`: extractors that speak here are those of a pool, and no other stack."""

    def __init__(
        self, url: str, channel_prefix: str, owns_pid: Callable[[int], bool], shares_extractors: bool = False
    ) -> None:
        self.progress = Progress()
        self.foreign = ""  # a living process that was on this bus before us
        self.others_heard_at = 0.0  # monotonic seconds: the last status of a process that is not ours
        self._began_us = int(time.time() * 1e6)
        self._owns_pid = owns_pid
        self._shares_extractors = shares_extractors
        self._channel_prefix = channel_prefix
        self._host = os.uname().nodename
        try:
            self._lcm = lcm.LCM(url)
            for channel, handler in (("STATUS", self._on_status), ("POSE", self._on_pose)):
                self._lcm.subscribe(channel_prefix + channel, handler).set_queue_capacity(QUEUE_CAPACITY)
        except RuntimeError as error:
            raise RunFailed(
                f"the bus {url} can't be opened ({error}): is multicast possible on this machine? Try: "
                "sudo ip link set lo multicast on; sudo ip route add 224.0.0.0/4 dev lo"
            ) from error

    def listen(self, milliseconds: int) -> None:
        """Handles what comes within this time."""
        deadline = time.monotonic() + milliseconds / 1000
        while (left_s := deadline - time.monotonic()) > 0:
            # Waiting inside LCM would turn a signal into an error.
            if select.select([self._lcm.fileno()], [], [], left_s)[0]:
                self._lcm.handle_timeout(0)

    def is_free(self) -> bool:
        """Whether no stack speaks on the bus, which every stage does ten times a second."""
        heard = []
        subscription = self._lcm.subscribe(
            self._channel_prefix + "HEARTBEAT", lambda _channel, data: heard.append(_publisher(data))
        )
        self.listen(FREE_BUS_MS)
        self._lcm.unsubscribe(subscription)
        return all(self._is_of_pool(name) for name in heard) and not self.foreign

    def _is_of_pool(self, name: str) -> bool:
        return self._shares_extractors and name.startswith("extractor")

    def _on_status(self, _channel: str, data: bytes) -> None:
        try:
            message = stage_status_t.decode(data)
        except DECODE_ERRORS:
            return
        if not STARTING <= message.state <= FAILED:
            return
        report = _to_report(message)
        if not self._owns_pid(message.pid):
            self.others_heard_at = time.monotonic()
        if message.host == self._host and self._owns_pid(message.pid):
            self.progress.stages[report.name] = report
            if report.name == "camera" and report.values.get("num_frames", 0) > 0:
                self.progress.num_frames = int(report.values["num_frames"])
        elif (
            message.host == self._host
            and message.stage_epoch_us < self._began_us
            and os.path.exists(f"/proc/{message.pid}")
            and not self._is_of_pool(message.name)
        ):
            self.foreign = f"{message.name}, process {message.pid}"

    def _on_pose(self, _channel: str, data: bytes) -> None:
        try:
            message = pose_t.decode(data)
        except DECODE_ERRORS:
            return
        if message.header.publisher == "tracker" and message.state in TRACKING_STATES:
            self.progress.add_pose(message.frame, TRACKING_STATES[message.state])


def _publisher(data: bytes) -> str:
    """Of a heartbeat; empty if it makes no sense."""
    try:
        return heartbeat_t.decode(data).header.publisher
    except DECODE_ERRORS:
        return ""


def _to_report(message: stage_status_t) -> StageReport:
    return StageReport(
        name=message.name,
        host=message.host,
        pid=message.pid,
        epoch_us=message.stage_epoch_us,
        state=message.state,
        dropped=message.num_dropped,
        repaired=message.num_repaired,
        lost=message.num_lost,
        undecodable=message.num_undecodable,
        queue=message.queue,
        step_ms=message.step_median_ms,
        cpu_percent=message.cpu_percent,
        rss_mb=message.rss_mb,
        last_error=message.last_error,
        values=dict(zip(message.value_names, message.values)),
        heard_at=time.monotonic(),
    )
