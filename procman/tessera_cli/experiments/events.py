"""When each process published what, read from the log of a run that was recorded (tessera run --record).

    python -P -m tessera_cli.experiments.events LOG EVENTS.csv

is a process of its own, since messages must be decoded with the types of the build that made them: TESSERA_BUILD.
Events are small, where the log holds every image; so it can be removed afterwards.
"""

import csv
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tessera_cli.files import replacing


@dataclass(frozen=True)
class Event:
    """A value was published. Its sender's clock is that of all processes of this machine."""

    channel: str
    publisher: str
    utime_us: int
    frame: int  # that it belongs to; of STATUS: -1
    number: int = -1  # of MAP_DELTA; of POSE: the first delta that its frame did not see
    step_ms: float = 0.0  # of STATUS: the mean step so far


COLUMNS = ("channel", "publisher", "utime_us", "frame", "number", "step_ms")


def is_job(channel: str) -> bool:
    """Of some extractor: TILE_0, TILE_1, ..."""
    return channel.startswith("TILE_") and channel[5:].isdecimal()


# By channel: the message's type, and its frame, number and step. Frames of MAP_DELTA and LOOP_RESULT are keyframes'
# numbers until `number_keyframes`.
Fields = tuple[int, int, float]
READERS: dict[str, tuple[str, Callable[[Any], Fields]]] = {
    "CAMERA": ("camera_image_t", lambda message: (message.frame, -1, 0.0)),
    "TILE": ("tile_job_t", lambda message: (message.frame, -1, 0.0)),
    "TILE_FEATURES": ("tile_features_t", lambda message: (message.frame, -1, 0.0)),
    "FEATURES": ("features_t", lambda message: (message.keypoints.frame, -1, 0.0)),
    "POSE": ("pose_t", lambda message: (message.frame, message.num_deltas, 0.0)),
    "KEYFRAME": ("keyframe_t", lambda message: (message.keypoints.frame, message.keyframe, 0.0)),
    "MAP_DELTA": ("map_delta_t", lambda message: (message.answers, message.number, 0.0)),
    "LOOP_RESULT": ("loop_result_t", lambda message: (message.keyframe, -1, 0.0)),
    "STATUS": ("stage_status_t", lambda message: (-1, -1, message.step_mean_ms)),
}
NUMBERED_BY_KEYFRAME = ("MAP_DELTA", "LOOP_RESULT")


def read_log(path: Path) -> list[Event]:
    """In the order of the log. A value in several messages counts once, when its first one was sent."""
    from tessera_cli import lcm_bus, messages

    events = []
    for channel, data in lcm_bus.log_events(path):
        reader = READERS.get("TILE" if is_job(channel) else channel)
        message = messages.receive_as(reader[0], data) if reader else None
        if reader and message is not None and message.header.part == 0:
            header = message.header
            events.append(Event(channel, header.publisher, header.utime, *reader[1](message)))
    return number_keyframes(events)


def number_keyframes(events: Iterable[Event]) -> list[Event]:
    """With frames where there were keyframes' numbers; what answers an unknown keyframe is left out."""
    given = list(events)
    frame_of = {event.number: event.frame for event in given if event.channel == "KEYFRAME"}
    numbered = []
    for event in given:
        if event.channel not in NUMBERED_BY_KEYFRAME:
            numbered.append(event)
        elif event.frame in frame_of:
            values = {**vars(event), "frame": frame_of[event.frame]}
            numbered.append(Event(**values))
    return numbered


def write_events(events: list[Event], path: Path) -> None:
    with replacing(path) as written, open(written, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows([getattr(event, column) for column in COLUMNS] for event in events)


def read_events(path: Path) -> list[Event]:
    with open(path, newline="") as file:
        return [
            Event(
                row["channel"],
                row["publisher"],
                int(row["utime_us"]),
                int(row["frame"]),
                int(row["number"]),
                float(row["step_ms"]),
            )
            for row in csv.DictReader(file)
        ]


if __name__ == "__main__":
    write_events(read_log(Path(sys.argv[1])), Path(sys.argv[2]))
