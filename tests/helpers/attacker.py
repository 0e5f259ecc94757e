"""A stranger on the bus, who hears everything and forges whatever could hurt: python -m helpers.attacker PORT SECONDS.

It knows no secret. Most forgeries are genuine messages, changed: with the publisher's name, epoch and next number. It
repeats all of them until its time is over, and then prints how many it sent, by name, as JSON.
"""

import importlib
import json
import os
import random
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import lcm

from tessera_cli.constants import FIRST_TILE_PORT_OFFSET, LAN_TILE_GROUP, MULTICAST_GROUP
from tessera_cli.lcm_bus import bus_url, stack_bus_url
from tessera_cli.membership import sign_message
from tessera_cli.messages import receive_as

tessera: Any = importlib.import_module("tessera")  # the generated types; found since messages was imported

Attack = Callable[["Attacker"], None]
ATTACKS: dict[str, Attack] = {}
FAR = 2_000_000_000
# Of a flood, in one go; more would only be lost in the attacker's own socket.
FLOOD = 300
ROUND_S = 0.25
TYPES = {
    "CAMERA": "camera_image_t",
    "CALIBRATION": "calibration_t",
    "GROUND_TRUTH": "ground_truth_t",
    "END_OF_STREAM": "end_of_stream_t",
    "TILE_0": "tile_job_t",
    "EXTRACTOR_READY": "extractor_ready_t",
    "TILE_FEATURES": "tile_features_t",
    "TILE_ACK": "tile_ack_t",
    "FEATURES": "features_t",
    "POSE": "pose_t",
    "KEYFRAME": "keyframe_t",
    "MAP_DELTA": "map_delta_t",
    "MAP_REQUEST": "map_request_t",
    "MAP_SNAPSHOT": "map_snapshot_t",
    "REMOVED_KEYFRAMES": "removed_keyframes_t",
    "LOOP_RESULT": "loop_result_t",
    "GLOBAL_ADJUSTMENT": "global_adjustment_t",
    "RELOCALIZATION_REQUEST": "relocalization_request_t",
    "RELOCALIZATION": "relocalization_t",
    "STATUS": "stage_status_t",
    "HEARTBEAT": "heartbeat_t",
    "REPAIR": "repair_request_t",
}
# Stages and the channels whose streams they own.
OWNERS = {
    "camera": "CAMERA",
    "dispatcher": "TILE_0",
    "reassembler": "FEATURES",
    "tracker": "POSE",
    "mapper": "MAP_DELTA",
    "loop_closer": "LOOP_RESULT",
    "global_adjuster": "GLOBAL_ADJUSTMENT",
    "extractor_0": "TILE_FEATURES",
}
MAP_CHANNELS = ("FEATURES", "KEYFRAME", "MAP_DELTA", "MAP_SNAPSHOT", "GLOBAL_ADJUSTMENT")


def bus_of(channel: str) -> str:
    if channel.startswith("TILE_0"):
        return "tile"
    if channel in MAP_CHANNELS:
        return "map"
    return {"CAMERA": "camera", "TILE_FEATURES": "work"}.get(channel, "main")


class Attacker:
    """Hears all buses of the stack at `port`, and sends on them."""

    def __init__(self, port: int, time_to_live: int = 0, secret: bytes | None = None) -> None:
        """`secret`: it is a member, and a bad one."""
        self._secret = secret
        self._publisher = ""  # under which name all is sent; empty: under that of whom it imitates
        self._sequences: Counter[str] = Counter()  # under that name, by channel
        names = ("main", "camera", "work", "map") if time_to_live else ("main", "camera", "work")
        urls = {name: stack_bus_url(name, port, bool(time_to_live)) for name in names}
        group = LAN_TILE_GROUP.format(id=0) if time_to_live else MULTICAST_GROUP
        urls["tile"] = bus_url(port + FIRST_TILE_PORT_OFFSET, time_to_live, group)
        self._buses = {name: lcm.LCM(url) for name, url in urls.items()}
        self.randomness = random.Random(5)
        self.num_sent: Counter[str] = Counter()
        self.name = ""  # of the attack that is under way
        self._own: set[int] = set()  # hashes of what this sent
        self.captured: dict[tuple[str, str], list[bytes]] = {}  # by channel and publisher: the first ones and the last
        for bus in self._buses.values():
            bus.subscribe(".*", self._on_message).set_queue_capacity(100)

    def _on_message(self, channel: str, data: bytes) -> None:
        message = receive_as(TYPES.get(channel, ""), data)
        if message is not None and hash(data) not in self._own:
            kept = self.captured.setdefault((channel, message.header.publisher), [])
            kept[3:] = [data]
            if len(kept) < 4:
                kept.append(data)

    def listen(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            for bus in self._buses.values():
                for _ in range(50):
                    if bus.handle_timeout(0) <= 0:
                        break
            time.sleep(0.005)

    def epoch_of(self, publisher: str) -> int:
        epochs = [
            self._decode(channel, data[-1]).header.epoch_us
            for (channel, name), data in self.captured.items()
            if name == publisher
        ]
        return max(epochs, default=1)

    def _decode(self, channel: str, data: bytes) -> Any:
        return receive_as(TYPES[channel], data)

    def like(self, channel: str, publisher: str) -> Any:
        """The last genuine message, to be changed and sent as the next one; one of our own if there was none."""
        data = self.captured.get((channel, publisher))
        message = self._decode(channel, data[-1]) if data else getattr(tessera, TYPES[channel])()
        header = message.header
        if not data:
            header.publisher, header.epoch_us, header.sequence, header.num_parts = (
                publisher,
                self.epoch_of(publisher),
                -1,
                1,
            )
        header.sequence += 1
        header.part, header.num_parts = 0, 1
        return message

    def send(self, channel: str, message: Any) -> None:
        if self._publisher:
            header = message.header
            header.publisher, header.sequence = self._publisher, self._sequences[channel]
            self._sequences[channel] += 1
        if not message.header.tag:
            message.header.tag = self.randomness.randbytes(16)
        self.send_bytes(channel, message.encode())

    def send_bytes(self, channel: str, data: bytes) -> None:
        if self._secret:
            data = sign_message(channel, data, self._secret)
        self._own.add(hash(data))
        try:
            self._buses.get(bus_of(channel), self._buses["main"]).publish(channel, data)
        except (OSError, RuntimeError):
            return
        self.num_sent[self.name] += 1

    def attack(self, name: str, publisher: str) -> None:
        """One attack, under a name of its own."""
        self.name, self._publisher = name, publisher
        ATTACKS[name](self)

    def attack_all(self) -> None:
        for self.name, attack in ATTACKS.items():
            attack(self)


def attack(name: str) -> Callable[[Attack], Attack]:
    def add(function: Attack) -> Attack:
        ATTACKS[name] = function
        return function

    return add


def add_end_of(stage: str) -> None:
    @attack(f"END_OF_STREAM of the {stage}")
    def end(attacker: Attacker) -> None:
        message = attacker.like("END_OF_STREAM", stage)
        message.stage, message.num_frames, message.num_dropped, message.num_values = stage, 20, 0, 1
        attacker.send("END_OF_STREAM", message)


def add_status(stage: str, state: int, word: str) -> None:
    @attack(f"STATUS of the {stage}: {word}")
    def status(attacker: Attacker) -> None:
        message = attacker.like("STATUS", stage)
        message.name, message.host, message.state = stage, os.uname().nodename, state
        attacker.send("STATUS", message)


def add_heartbeat(stage: str, channel: str) -> None:
    def heartbeat(attacker: Attacker, epoch_step_us: int, first: int, following: int, sequence_step: int) -> None:
        message = attacker.like("HEARTBEAT", stage)
        message.header.epoch_us += epoch_step_us
        message.header.sequence += sequence_step
        head = tessera.stream_head_t()
        head.channel, head.epoch_us, head.is_exclusive = channel, message.header.epoch_us, True
        head.first_sequence, head.next_sequence = first, following
        message.host, message.pid, message.num_streams, message.streams = "elsewhere", 1, 1, [head]
        attacker.send("HEARTBEAT", message)

    ATTACKS[f"HEARTBEAT of an older {stage}"] = lambda attacker: heartbeat(attacker, -1000, 0, 0, 0)
    ATTACKS[f"HEARTBEAT of a newer {stage}"] = lambda attacker: heartbeat(attacker, 1000, 0, 0, 0)
    ATTACKS[f"HEARTBEAT of the {stage}: all before is gone"] = lambda attacker: heartbeat(attacker, 0, 9999, 9999, 1)
    ATTACKS[f"HEARTBEAT of the {stage}: much more to come"] = lambda attacker: heartbeat(attacker, 0, 0, 900_000, 1)


def add_next(channel: str, publisher: str, word: str, change: Callable[[Any], None]) -> None:
    """The next message of a stream, with other content; as it would come, and from a newer life."""

    def forge(attacker: Attacker, epoch_step_us: int) -> None:
        message = attacker.like(channel, publisher)
        if epoch_step_us:
            message.header.epoch_us, message.header.sequence = message.header.epoch_us + epoch_step_us, 0
        change(message)
        attacker.send(channel, message)

    ATTACKS[f"{channel} in sequence: {word}"] = lambda attacker: forge(attacker, 0)
    ATTACKS[f"{channel} of a newer {publisher}: {word}"] = lambda attacker: forge(attacker, 1000)


def setting(**values: Any) -> Callable[[Any], None]:
    def change(message: Any) -> None:
        for name, value in values.items():
            setattr(message, name, value)

    return change


def plus(name: str, step: int) -> Callable[[Any], None]:
    return lambda message: setattr(message, name, getattr(message, name) + step)


def nothing(_message: Any) -> None:
    """The content stays: a value twice."""


def no_change(message: Any) -> None:
    message.number += 1
    message.change = tessera.map_change_t()


for each in ("camera", "dispatcher", "reassembler", "tracker", "mapper"):
    add_end_of(each)
for each in ("evaluator", "tracker", "mapper"):
    add_status(each, tessera.stage_status_t.FINISHED, "finished")
add_status("evaluator", tessera.stage_status_t.FAILED, "failed")
for each, of in OWNERS.items():
    add_heartbeat(each, of)
add_next("POSE", "tracker", "a frame far beyond", plus("frame", FAR))
add_next("POSE", "tracker", "the next frame, lost", plus("frame", 1))
add_next("POSE", "tracker", "frame -1", setting(frame=-1))
add_next("KEYFRAME", "tracker", "the next one", plus("keyframe", 1))
add_next("FEATURES", "reassembler", "a frame twice", nothing)
add_next("MAP_DELTA", "mapper", "no change", no_change)
add_next("MAP_DELTA", "mapper", "far beyond", plus("number", FAR))
add_next("REMOVED_KEYFRAMES", "mapper", "twice", nothing)
add_next("LOOP_RESULT", "loop_closer", "the next keyframe, no loop", plus("keyframe", 1))
add_next("GLOBAL_ADJUSTMENT", "global_adjuster", "of nothing", nothing)
add_next("RELOCALIZATION", "loop_closer", "here", setting(frame=20, reference=0))
add_next("TILE_FEATURES", "extractor_0", "without any", setting(num_total=0, first=0, num_candidates=0))
add_next("TILE_0", "dispatcher", "another frame", plus("frame", 1))
add_next("CAMERA", "camera", "frame 2000", setting(frame=2000))
add_next("CALIBRATION", "camera", "again", nothing)
add_next("GROUND_TRUTH", "camera", "the next frame", plus("frame", 1))
add_next("TILE_ACK", "reassembler", "all of the next frame", plus("frame", 1))
add_next("EXTRACTOR_READY", "extractor_0", "begins anew", plus("extractor_epoch_us", 1))


@attack("STATUS of this machine's process 1")
def other_stack(attacker: Attacker) -> None:
    message = attacker.like("STATUS", "mapper")
    message.name, message.host, message.pid, message.stage_epoch_us = "mapper", os.uname().nodename, 1, 1
    attacker.send("STATUS", message)


@attack("STATUS with a name that is no text")
def bad_name(attacker: Attacker) -> None:
    message = attacker.like("STATUS", "mapper")
    message.name = "mapper?"
    attacker.send_bytes("STATUS", message.encode().replace(b"mapper?", b"mapper\xff"))


@attack("EXTRACTOR_READY of extractors that are none")
def false_extractors(attacker: Attacker) -> None:
    for number in (1, 7, 255):
        message = attacker.like("EXTRACTOR_READY", f"extractor_{number}")
        message.extractor, message.num_robots, message.header.epoch_us = number, 1, attacker.epoch_of("tracker")
        attacker.send("EXTRACTOR_READY", message)


@attack("MAP_REQUEST, many")
def map_requests(attacker: Attacker) -> None:
    message = attacker.like("MAP_REQUEST", "evaluator")
    message.next_delta = message.snapshot = -1
    for _ in range(FLOOD):
        message.header.sequence += 1
        attacker.send("MAP_REQUEST", message)


@attack("REPAIR, many")
def repairs(attacker: Attacker) -> None:
    message = attacker.like("REPAIR", "mapper")
    message.channel, message.stream_publisher, message.stream_epoch_us = (
        "FEATURES",
        "reassembler",
        attacker.epoch_of("reassembler"),
    )
    message.num_ranges, message.first_sequence, message.last_sequence = 1, [0], [100_000]
    for _ in range(FLOOD):
        message.header.sequence += 1
        attacker.send("REPAIR", message)


@attack("publishers without number")
def many_names(attacker: Attacker) -> None:
    message = attacker.like("POSE", "tracker")
    for _ in range(FLOOD):
        message.header.publisher = f"tracker_{attacker.randomness.randrange(10**9)}"
        attacker.send("POSE", message)


@attack("noise")
def noise(attacker: Attacker) -> None:
    for _ in range(FLOOD // 10):
        for channel in TYPES:
            attacker.send_bytes(channel, attacker.randomness.randbytes(attacker.randomness.randrange(2000)))


@attack("genuine messages with one bit changed")
def changed_bits(attacker: Attacker) -> None:
    for (channel, _), kept in list(attacker.captured.items()):
        data = bytearray(kept[-1])
        position = attacker.randomness.randrange(8, len(data))
        data[position] ^= 1 << attacker.randomness.randrange(8)
        attacker.send_bytes(channel, bytes(data))


@attack("genuine messages, later once more")
def replays(attacker: Attacker) -> None:
    for (channel, _), kept in list(attacker.captured.items()):
        for data in kept:
            attacker.send_bytes(channel, data)


@attack("genuine messages on other channels")
def moved(attacker: Attacker) -> None:
    for (channel, _), kept in list(attacker.captured.items()):
        for other in TYPES:
            if other != channel and bus_of(other) == bus_of(channel):
                attacker.send_bytes(other, kept[-1])


def main() -> None:
    port, seconds = int(sys.argv[1]), float(sys.argv[2])
    signal.signal(signal.SIGINT, signal.default_int_handler)  # what a background job ignores
    attacker = Attacker(port, int(sys.argv[3]) if len(sys.argv) > 3 else 0)
    until = time.monotonic() + seconds
    try:
        while time.monotonic() < until:
            attacker.listen(ROUND_S)
            if ("POSE", "tracker") in attacker.captured:
                attacker.attack_all()
    except KeyboardInterrupt:
        pass
    print(json.dumps(attacker.num_sent))


if __name__ == "__main__":
    main()
