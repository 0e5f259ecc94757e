"""tessera replay LOG --only STAGE: one stage gets what it got when the log was recorded, and must say the same.

The messages of all others are published as they were recorded; what the stage says is compared with what it said then,
message by message. Times of measuring are no difference. Finds the first process that a change of the code has changed.
"""

import re
import tempfile
import time
from argparse import Namespace
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from tessera_cli.console import say
from tessera_cli.constants import HEARTBEAT, LISTEN_S, RECEIVE_BUFFER_BYTES, REPAIR, START_TIMEOUT_S, STATUS
from tessera_cli.errors import RunError, UserError
from tessera_cli.files import absolute
from tessera_cli.interrupt import Interrupt
from tessera_cli.lcm_bus import Bus, LoggedEvent, bus_url, listen, read_log
from tessera_cli.messages import header_of, receive_logged, repair_request_t, stage_status_t
from tessera_cli.runs.ports import take_free_port
from tessera_cli.runs.run_settings import user_assignments
from tessera_cli.settings import write_settings
from tessera_cli.supervision.attributes import RunOptions
from tessera_cli.supervision.private_deputy import PrivateDeputy
from tessera_cli.supervision.process_list import Process
from tessera_cli.supervision.state_folder import LogFolder

# Stages whose output is fixed by their input, whatever the time at which it comes. (The reassembler takes only what was
# asked for in its own life.)
STAGES = ("extractor", "tracker", "mapper", "loop_closer", "global_adjuster")
# Large; nobody else listens to them.
ONLY_FOR = {"CAMERA": "dispatcher", "TILE": "extractor", "TILE_FEATURES": "reassembler"}
# When these are said depends on time, or on what was lost on the way.
NOT_COMPARED = (STATUS, HEARTBEAT, REPAIR, "EXTRACTOR_READY", "TILE_ACK", "MAP_REQUEST", "MAP_SNAPSHOT")
# A mapper that is asked for the map says its last deltas again, which is no difference either.
NOT_REPLAYED = (STATUS, HEARTBEAT, REPAIR, "MAP_REQUEST")
# For measuring only, or different in each life of a process.
MEASURED_FIELDS = ("header", "captured", "latency", "map_wait_us")
# The recorder may have heard an answer before the question: after so long without an answer, the next is asked.
PATIENCE_S = 0.5
# After this long without an answer behind the last input, it does not come.
ANSWER_TIMEOUT_S = 20.0
# Inputs that may not have arrived are sent again, those of the last so many.
NUM_REPEATED = 200
MAX_REPAIRED = 100  # messages of one request
BUS_KEYS = ("main_url", "camera_url", "color_url", "work_url", "map_url", "tile_url")


@dataclass
class Recording:
    """What a log has of one stage."""

    inputs: list[LoggedEvent] = field(default_factory=list)  # in the order of the log, as are
    due: list[int] = field(default_factory=list)  # how many outputs it had said before each input
    # By channel, publisher, its epoch, number of the message.
    input_by_number: dict[tuple[str, str, int, int], LoggedEvent] = field(default_factory=dict)
    outputs: dict[str, list[bytes]] = field(default_factory=dict)  # by channel, in the order of their numbers
    num_outputs: int = 0


def read_recording(log: Path, stage: str, prefix: str) -> Recording:
    """Raises UserError if the log does not tell all that the stage said in one life."""
    recording, lives, num_said, last_delta = Recording(), set[int](), Counter[str](), (-1, -1)
    for event in read_log(log):
        header, channel = header_of(event.data), event.channel.removeprefix(prefix)
        if header is None or channel in NOT_REPLAYED or not event.channel.startswith(prefix):
            continue
        if header.publisher != stage:
            if _is_for(channel, stage):
                recording.inputs.append(event)
                recording.due.append(recording.num_outputs)
                recording.input_by_number[channel, header.publisher, header.epoch_us, header.sequence] = event
        elif channel not in NOT_COMPARED:
            lives.add(header.epoch_us)
            if header.sequence != num_said[channel]:
                raise UserError(
                    f"{log} lacks message {num_said[channel]} of {stage} on {channel}: record the run again."
                )
            num_said[channel] += 1
            if channel == "MAP_DELTA" and (message := receive_logged(event.data)) is not None:
                delta = (message.number, header.part)
                if delta <= last_delta:
                    continue
                last_delta = delta
            recording.outputs.setdefault(channel, []).append(event.data)
            recording.num_outputs += 1
    if not recording.outputs:
        raise UserError(f"{log} has nothing that {stage} said: record the whole stack, by tessera run --record.")
    if len(lives) > 1:
        raise UserError(f"{stage} was restarted while {log} was recorded: its lives can't be compared.")
    return recording


def _is_for(channel: str, stage: str) -> bool:
    kind = re.sub(r"_\d+$", "", channel)
    if kind == "TILE":
        return channel.removeprefix("TILE_") == stage.removeprefix("extractor_")
    return stage.startswith(ONLY_FOR.get(kind, ""))


def replay_stage(arguments: Namespace) -> int:
    """`arguments`: those of `tessera replay`. Exit status 1 if the stage says something else."""
    log, stage = absolute(arguments.log), arguments.only
    command, _, instance = stage.partition("_") if stage.startswith("extractor_") else (stage, "", "0")
    if command not in STAGES or not instance.isdecimal() or stage == "extractor":
        raise UserError(f"--only {stage}: one of extractor_0, extractor_1, ..., {', '.join(STAGES[1:])}.")
    if not log.is_file():
        raise UserError(f"there is no log {log}.")
    recording = read_recording(log, stage, arguments.prefix)
    if arguments.port is None:
        arguments.port, _lock = take_free_port(arguments.prefix)  # held until the end
    process = Process(stage, command, "", int(instance), (), RunOptions(ready="started", auto_respawn="never"))
    with tempfile.TemporaryDirectory(prefix="tessera-replay-") as folder:
        settings_path = Path(folder) / "settings.yaml"
        url = bus_url(arguments.port)
        write_settings(_assignments(arguments, log, url), settings_path, _settings_of(log))
        logs = LogFolder(Path(folder) / "stages", f"{folder} is in use.")
        deputy = PrivateDeputy(logs, settings_path, [process])
        say(f"{stage} gets {len(recording.inputs):,} recorded messages; it said {recording.num_outputs:,} then")
        try:
            difference = StageReplay(recording, stage, arguments.prefix, url, deputy).run()
        finally:
            deputy.kill()
    channels = ", ".join(f"{len(said):,} on {channel}" for channel, said in sorted(recording.outputs.items()))
    say(difference or f"{stage} says the same: {channels}")
    return 1 if difference else 0


def _settings_of(log: Path) -> Path | None:
    """Those of the run whose recording it is."""
    path = log.parent / "settings.yaml"
    if path.is_file():
        return path
    say(f"there is no {path}: the defaults and --set are taken, which must be the settings of the recording")
    return None


def _assignments(arguments: Namespace, log: Path, url: str) -> list[str]:
    """One bus for all, and nothing is written."""
    return [
        *(f"bus.{key}={url}" for key in BUS_KEYS),
        f"bus.channel_prefix={arguments.prefix}",
        "bus.run_dir=",
        "stream.journal_dir=",
        f"tracker.replay_log={log}",
        *user_assignments(arguments),
    ]


class StageReplay:
    """Feeds the stage and compares what it says."""

    def __init__(self, recording: Recording, stage: str, prefix: str, url: str, deputy: PrivateDeputy) -> None:
        self._recording, self._stage, self._prefix, self._deputy = recording, stage, prefix, deputy
        self._heard: dict[str, set[int]] = {channel: set() for channel in recording.outputs}
        self._num_heard, self._heard_at = 0, 0.0
        self._is_running, self._difference = False, ""
        self._interrupt = Interrupt()
        self._epoch_us = 0  # of the stage
        self._bus = Bus(f"{url}&recv_buf_size={RECEIVE_BUFFER_BYTES}", "replay")  # it hears its own messages too
        self._bus.subscribe(f"{prefix}{STATUS}", stage_status_t, self._on_status)
        self._bus.subscribe(f"{prefix}{REPAIR}", repair_request_t, self._on_repair)
        for channel in recording.outputs:
            self._bus.subscribe(f"{prefix}{channel}", None, partial(self._on_output, channel))

    def run(self) -> str:
        """The first difference in a sentence; empty: none."""
        self._deputy.start()
        self._wait(START_TIMEOUT_S, lambda: self._is_running)
        if not self._is_running:
            raise RunError(f"{self._stage} did not report within {START_TIMEOUT_S:.0f} s.")
        for i, event in enumerate(self._recording.inputs):
            self._wait(PATIENCE_S, partial(self._has_heard, self._recording.due[i]))
            if self._difference:
                return self._difference
            if not self._has_heard(self._recording.due[i]):
                self._ask_again()
            self._bus.publish(event.channel, event.data)
        self._finish()
        return self._difference or self._missing()

    def _finish(self) -> None:
        """Waits for the last answers; what may have been lost on the way is sent once more."""
        while not self._is_complete and time.monotonic() - self._heard_at < ANSWER_TIMEOUT_S:
            self._wait(PATIENCE_S, lambda: self._is_complete)
            if self._difference:
                return
            if not self._is_complete:
                self._ask_again()
                for event in self._recording.inputs[-NUM_REPEATED:]:
                    self._bus.publish(event.channel, event.data)
        self._wait(PATIENCE_S, lambda: False)  # does it say more than it did?

    def _has_heard(self, number: int) -> bool:
        return self._num_heard >= number

    @property
    def _is_complete(self) -> bool:
        return self._num_heard >= self._recording.num_outputs

    def _wait(self, seconds: float, condition: Callable[[], bool]) -> None:
        """Until the condition, a difference, or so long after the last answer."""
        self._heard_at = max(self._heard_at, 0.0) or time.monotonic()
        deadline = time.monotonic() + seconds
        while not condition() and not self._difference and time.monotonic() < deadline:
            listen([self._bus], LISTEN_S / 10)
            self._deputy.step()
            if self._interrupt.requested:
                raise RunError("interrupted.")

    def _ask_again(self) -> None:
        """For what the stage has said and was lost on the way here; it passes over what it hasn't said yet."""
        for channel, heard in self._heard.items():
            missing = [number for number in range(max(heard, default=-1) + 2) if number not in heard][:MAX_REPAIRED]
            request = repair_request_t()
            request.header = self._bus.header(self._prefix + REPAIR)
            request.channel, request.stream_publisher, request.stream_epoch_us = channel, self._stage, self._epoch_us
            request.num_ranges, request.first_sequence, request.last_sequence = len(missing), missing, missing
            self._bus.publish(self._prefix + REPAIR, request.encode())

    def _on_status(self, status: stage_status_t) -> None:
        """Before it runs, it would hear nothing."""
        is_up = status.state in (stage_status_t.RUNNING, stage_status_t.FINISHED)
        if status.name == self._stage and is_up:
            self._is_running, self._epoch_us = True, status.stage_epoch_us

    def _on_repair(self, request: repair_request_t) -> None:
        """The stage lacks messages: they were lost on the way, or stand later in the log."""
        for first, last in zip(request.first_sequence, request.last_sequence):
            for sequence in range(first, min(last, first + MAX_REPAIRED) + 1):
                key = (request.channel, request.stream_publisher, request.stream_epoch_us, sequence)
                if event := self._recording.input_by_number.get(key):
                    self._bus.publish(event.channel, event.data)

    def _on_output(self, channel: str, data: bytes) -> None:
        header = header_of(data)
        if header is None or header.publisher != self._stage or self._difference:
            return
        said, heard = self._recording.outputs[channel], self._heard[channel]
        if header.sequence in heard:
            return
        heard.add(header.sequence)
        self._num_heard += 1
        self._heard_at = time.monotonic()
        if header.sequence >= len(said):
            self._difference = f"{self._stage} says more on {channel} than the {len(said):,} messages of then."
        elif difference := compare(said[header.sequence], data):
            self._difference = f"{self._stage} differs first in message {header.sequence:,} on {channel}, {difference}."

    def _missing(self) -> str:
        for channel, said in self._recording.outputs.items():
            if missing := set(range(len(said))) - self._heard[channel]:
                number = min(missing)
                what = describe(said[number])
                return f"{self._stage} does not say message {number:,} of {len(said):,} on {channel}, {what}."
        return ""


def describe(data: bytes) -> str:
    """What a message is about: the first number that it has."""
    message = receive_logged(data)
    names = [name for name in getattr(message, "__slots__", []) if isinstance(getattr(message, name), int)]
    return f"{names[0]} {getattr(message, names[0])}" if names else "of its type"


def compare(recorded: bytes, now: bytes) -> str:
    """The first difference; empty: none but in times of measuring."""
    before, after = receive_logged(recorded), receive_logged(now)
    if before is None or after is None or type(before) is not type(after):
        return "whose type has changed"
    for name in ("part", "num_parts"):
        if getattr(before.header, name) != getattr(after.header, name):
            return f"of {describe(recorded)}: {_words(name, getattr(before.header, name), getattr(after.header, name))}"
    difference = next(differences(before, after), None)
    return f"of {describe(recorded)}: {difference}" if difference else ""


def differences(before: Any, after: Any, name: str = "") -> Iterator[str]:
    """All of two messages, or of parts of them, in the order of their fields."""
    if hasattr(before, "__slots__"):
        for slot in before.__slots__:
            if slot not in MEASURED_FIELDS:
                yield from differences(getattr(before, slot), getattr(after, slot), f"{name}.{slot}".lstrip("."))
    elif isinstance(before, list | tuple):
        if len(before) != len(after):
            yield _words(f"length of {name}", len(before), len(after))
        for i, (one, other) in enumerate(zip(before, after)):
            yield from differences(one, other, f"{name}[{i}]")
    elif isinstance(before, bytes) and before != after:
        place = next(
            (i for i, (one, other) in enumerate(zip(before, after)) if one != other), min(len(before), len(after))
        )
        yield f"{name} differs from byte {place} on"
    elif before != after and not (before != before and after != after):  # two NaN are the same
        yield _words(name, before, after)


def _words(name: str, before: object, after: object) -> str:
    return f"{name} was {before!r} and is {after!r}"
