"""The way of frames through the processes, from the times at which these published.

A message's header says when it was sent. A process works on one value after the other; so its step for a frame

  began   when its inputs had been sent and its step before was over, whichever came last
  ended   when it sent what it made

What it had to wait for follows from the data: the tracker for the delta that its frame must see, the mapper for the
loop results that are due (modules/mapping/correction_schedule.h). The camera and the dispatcher, which wait for room
further down, have their mean step from STATUS instead.
"""

from collections import defaultdict
from dataclasses import dataclass

from tessera_cli.experiments.events import Event, is_job

# The order in which a frame comes to them.
PROCESSES = ("camera", "dispatcher", "extractor", "reassembler", "tracker", "mapper", "loop_closer")


@dataclass(frozen=True)
class Step:
    """What one process did for one frame. Times are wall clock, us since 1970."""

    process: str
    frame: int
    ready_us: int  # the frame could have been worked on, had the process been free and nothing else missing
    began_us: int
    ended_us: int


class _Sent:
    """The events by channel and frame: when they were sent."""

    def __init__(self, events: list[Event]) -> None:
        self.by_channel: dict[str, list[Event]] = defaultdict(list)
        for event in sorted(events, key=lambda event: (event.utime_us, event.channel, event.publisher)):
            self.by_channel[event.channel].append(event)
        self._last = {
            (event.channel, event.frame): event.utime_us for each in self.by_channel.values() for event in each
        }
        self.deltas_us = {event.number: event.utime_us for event in self.by_channel["MAP_DELTA"]}
        self.step_us = {event.publisher: int(1000 * event.step_ms) for event in self.by_channel["STATUS"]}

    def at(self, channel: str, frame: int) -> int | None:
        """When the last value of this frame was sent there."""
        return self._last.get((channel, frame))


def reconstruct(events: list[Event], loop_delay_keyframes: int | None) -> list[Step]:
    """All steps in order of their ends. `loop_delay_keyframes`: the setting; None: the run closed no loops."""
    sent = _Sent(events)
    steps = [
        *_camera_steps(sent),
        *_dispatcher_steps(sent),
        *_extractor_steps(sent),
        *_reassembler_steps(sent),
        *_tracker_steps(sent),
        *_mapper_steps(sent, loop_delay_keyframes),
        *_loop_closer_steps(sent),
    ]
    return sorted(steps, key=lambda step: (step.ended_us, step.process, step.frame))


def _camera_steps(sent: _Sent) -> list[Step]:
    """Its images were decoded shortly before it sent them, or earlier if it had to wait."""
    step_us = sent.step_us.get("camera", 0)
    return [
        Step("camera", event.frame, event.utime_us - step_us, event.utime_us - step_us, event.utime_us)
        for event in sent.by_channel["CAMERA"]
    ]


def _dispatcher_steps(sent: _Sent) -> list[Step]:
    """A job is sent when an extractor is free; most of the step is the sending itself."""
    step_us = sent.step_us.get("dispatcher", 0)
    steps = []
    for channel, events in sent.by_channel.items():
        for event in events if is_job(channel) else []:
            ready_us = sent.at("CAMERA", event.frame)
            if ready_us is not None:
                began_us = max(ready_us, event.utime_us)
                steps.append(Step("dispatcher", event.frame, ready_us, began_us, began_us + step_us))
    return steps


def _extractor_steps(sent: _Sent) -> list[Step]:
    """Each answers its jobs in the order in which they came."""
    jobs: dict[tuple[str, int], list[int]] = defaultdict(list)  # by extractor and frame: when they were sent
    for channel, events in sent.by_channel.items():
        for event in events if is_job(channel) else []:
            jobs[f"extractor_{channel[5:]}", event.frame].append(event.utime_us)
    steps: list[Step] = []
    free_us: dict[str, int] = {}
    for event in sent.by_channel["TILE_FEATURES"]:
        waiting = jobs[event.publisher, event.frame]
        if waiting:
            ready_us = waiting.pop(0)
            steps.append(_step(event.publisher, event, ready_us, free_us.get(event.publisher, 0)))
        free_us[event.publisher] = event.utime_us
    return steps


def _reassembler_steps(sent: _Sent) -> list[Step]:
    return _steps_in_order("reassembler", sent, "TILE_FEATURES", "FEATURES")


def _tracker_steps(sent: _Sent) -> list[Step]:
    steps: list[Step] = []
    free_us = 0
    for event in sent.by_channel["POSE"]:
        ready_us = sent.at("FEATURES", event.frame)
        if ready_us is not None:
            map_us = sent.deltas_us.get(event.number - 1, 0)
            steps.append(_step("tracker", event, ready_us, max(free_us, map_us)))
        free_us = event.utime_us
    return steps


def _mapper_steps(sent: _Sent, loop_delay_keyframes: int | None) -> list[Step]:
    keyframes = [event.frame for event in sent.by_channel["KEYFRAME"]]
    index_of = {frame: index for index, frame in enumerate(keyframes)}
    last_delta = {event.frame: event for event in sent.by_channel["MAP_DELTA"]}
    steps: list[Step] = []
    free_us = 0
    for frame, event in last_delta.items():
        ready_us = sent.at("KEYFRAME", frame)
        loop_us = 0
        if loop_delay_keyframes is not None and index_of.get(frame, -1) >= loop_delay_keyframes:
            loop_us = sent.at("LOOP_RESULT", keyframes[index_of[frame] - loop_delay_keyframes]) or 0
        if ready_us is not None:
            steps.append(_step("mapper", event, ready_us, max(free_us, loop_us)))
        free_us = event.utime_us
    return steps


def _loop_closer_steps(sent: _Sent) -> list[Step]:
    return _steps_in_order("loop_closer", sent, "MAP_DELTA", "LOOP_RESULT")


def _steps_in_order(process: str, sent: _Sent, from_channel: str, to_channel: str) -> list[Step]:
    """Of a process that makes one value of another, one after the other."""
    steps: list[Step] = []
    free_us = 0
    for event in sent.by_channel[to_channel]:
        ready_us = sent.at(from_channel, event.frame)
        if ready_us is not None:
            steps.append(_step(process, event, ready_us, free_us))
        free_us = event.utime_us
    return steps


def _step(process: str, end: Event, ready_us: int, possible_us: int) -> Step:
    """`possible_us`: when the process was free and had everything else. Clocks may be off by some microseconds."""
    began_us = min(max(ready_us, possible_us), end.utime_us)
    return Step(process, end.frame, min(ready_us, began_us), began_us, end.utime_us)


def typical_frame(steps: list[Step]) -> int | None:
    """The frame whose way is drawn: a keyframe of the second half, whose way took as long as half of theirs or longer.

    Its way leads through all processes. None if no frame went all the way.
    """
    ways = {frame: way for frame, way in _ways(steps).items() if {"camera", "tracker", "mapper"} <= way.keys()}
    frames = sorted(ways)
    if not frames:
        return None
    later = [frame for frame in frames if frame >= frames[len(frames) // 2]]

    def duration_us(frame: int) -> int:
        way = ways[frame]
        return max(step.ended_us for step in way.values()) - way["camera"].began_us

    return sorted(later, key=lambda frame: (duration_us(frame), frame))[len(later) // 2]


def _ways(steps: list[Step]) -> dict[int, dict[str, Step]]:
    """By frame, the last step of each process."""
    ways: dict[int, dict[str, Step]] = defaultdict(dict)
    for step in steps:
        ways[step.frame][step.process] = step
    return ways


def busy_shares(steps: list[Step]) -> dict[str, float]:
    """For each process, the share of the time in which it worked, from the first frame to the last."""
    if not steps:
        return {}
    began_us, ended_us = min(step.began_us for step in steps), max(step.ended_us for step in steps)
    busy_us: dict[str, int] = defaultdict(int)
    for step in steps:
        busy_us[step.process] += step.ended_us - step.began_us
    return {process: busy / max(1, ended_us - began_us) for process, busy in busy_us.items()}


def row_order(processes: set[str]) -> list[str]:
    """As the data flow, extractors by number."""

    def position(name: str) -> tuple[int, int]:
        kind, _, number = name.rpartition("_")
        kind, number = (kind, number) if number.isdecimal() else (name, "0")
        return (PROCESSES.index(kind), int(number))

    return sorted(processes, key=position)
