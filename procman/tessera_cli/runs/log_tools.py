"""tessera log info, gaps, cut, filter and export: what is in a recorded LCM log, and parts of it as log or JSON."""

import base64
import fnmatch
import itertools
import json
import re
from argparse import Namespace
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tessera_cli.errors import UserError
from tessera_cli.files import absolute, replacing
from tessera_cli.lcm_bus import LoggedEvent, read_log, write_log
from tessera_cli.messages import header_of, receive_logged, type_name_of
from tessera_cli.text import visible

# What a player needs from before the part that is cut out.
KEPT_FROM_BEFORE = "CALIBRATION"
MAX_GAPS_SHOWN = 5


@dataclass
class ChannelFacts:
    """What a log has on one channel."""

    type_name: str
    num_events: int = 0
    num_bytes: int = 0
    first_us: int = 0
    last_us: int = 0
    publishers: set[str] = field(default_factory=set)


def info(arguments: Namespace) -> int:
    """A line about the log and one for each channel."""
    log, channels = _existing(arguments.log), dict[str, ChannelFacts]()
    for event in read_log(log):
        facts = channels.setdefault(
            event.channel, ChannelFacts(type_name_of(event.data) or "?", first_us=event.time_us)
        )
        facts.num_events += 1
        facts.num_bytes += len(event.data)
        facts.last_us = event.time_us
        if header := header_of(event.data):
            facts.publishers.add(header.publisher)
    first_us = min((facts.first_us for facts in channels.values()), default=0)
    duration_s = 1e-6 * (max((facts.last_us for facts in channels.values()), default=0) - first_us)
    num_events = sum(facts.num_events for facts in channels.values())
    print(f"{log}: {num_events:,} messages on {len(channels)} channels, {duration_s:.3f} s, {_megabytes(log)}")
    if channels:
        print(f"{'channel':24} {'messages':>9} {'per s':>8} {'MB':>9}  type, from")
    for name, facts in sorted(channels.items()):
        rate = f"{facts.num_events / duration_s:.1f}" if duration_s > 0 else ""
        origin = ", ".join(sorted(facts.publishers))
        line = f"{name:24} {facts.num_events:9,} {rate:>8} {1e-6 * facts.num_bytes:9.2f}  {facts.type_name}, {origin}"
        print(visible(line.rstrip(", ")))
    return 0


@dataclass
class Stream:
    """The messages of one publisher, since its start, on one channel."""

    times_us: dict[int, int] = field(default_factory=dict)  # by number; of the first copy
    num_copies: int = 0
    num_late: int = 0  # behind one with a higher number
    highest: int = -1

    def add(self, number: int, time_us: int) -> None:
        self.num_copies += number in self.times_us
        self.num_late += number < self.highest
        self.highest = max(self.highest, number)
        self.times_us.setdefault(number, time_us)

    def gaps(self) -> list[tuple[int, int]]:
        """First and last missing number of each; what was sent before the first message that is there is none."""
        pairs = itertools.pairwise(sorted(self.times_us))
        return [(before + 1, after - 1) for before, after in pairs if after > before + 1]


def gaps(arguments: Namespace) -> int:
    """A line for each stream that is not whole. Exit status 1 if messages are missing."""
    log, streams, began_us = _existing(arguments.log), dict[tuple[str, str, int], Stream](), None
    for event in read_log(log):
        began_us = event.time_us if began_us is None else began_us
        if header := header_of(event.data):
            key = (event.channel, header.publisher, header.epoch_us)
            streams.setdefault(key, Stream()).add(header.sequence, event.time_us)
    num_missing = 0
    for (channel, publisher, _), stream in sorted(streams.items()):
        missing = sum(last - first + 1 for first, last in stream.gaps())
        num_missing += missing
        if missing or stream.num_copies or stream.num_late:
            words = _describe(stream, missing, began_us or 0)
            print(visible(f"{channel} of {publisher}: {'; '.join(words)}"))
    print(f"{log}: {num_missing:,} messages are missing in {len(streams)} streams")
    return 1 if num_missing else 0


def _describe(stream: Stream, missing: int, began_us: int) -> list[str]:
    words = []
    if missing:
        found = stream.gaps()
        places = ", ".join(_place(stream, gap, began_us) for gap in found[:MAX_GAPS_SHOWN])
        more = f" and {len(found) - MAX_GAPS_SHOWN} more" if len(found) > MAX_GAPS_SHOWN else ""
        words.append(f"{missing:,} of {missing + len(stream.times_us):,} messages are missing: {places}{more}")
    if stream.num_copies:
        words.append(f"{stream.num_copies:,} came again")
    if stream.num_late:
        words.append(f"{stream.num_late:,} came out of order")
    return words


def _place(stream: Stream, gap: tuple[int, int], began_us: int) -> str:
    first, last = gap
    numbers = f"{first}" if first == last else f"{first} to {last}"
    return f"{numbers} (before {1e-6 * (stream.times_us[last + 1] - began_us):.3f} s)"


def cut(arguments: Namespace) -> int:
    """The part between two times; the camera's calibration is kept from before."""
    first_s, last_s = arguments.first, arguments.last
    if last_s is not None and last_s <= first_s:
        raise UserError(f"--from {first_s:g} --to {last_s:g}: nothing lies between.")
    began_us: int | None = None

    def is_wanted(event: LoggedEvent) -> bool:
        nonlocal began_us
        began_us = event.time_us if began_us is None else began_us
        time_us = event.time_us - began_us
        if last_s is not None and time_us >= round(1e6 * last_s):
            return False
        return time_us >= round(1e6 * first_s) or event.channel.endswith(KEPT_FROM_BEFORE)

    return _copy(arguments, is_wanted)


def filter_channels(arguments: Namespace) -> int:
    """Only some channels, or all but these."""

    def is_wanted(event: LoggedEvent) -> bool:
        return _is_named(event.channel, arguments.channels) != arguments.without

    return _copy(arguments, is_wanted)


def _is_named(channel: str, patterns: list[str]) -> bool:
    return any(fnmatch.fnmatchcase(channel, pattern) for pattern in patterns)


def _copy(arguments: Namespace, is_wanted: Callable[[LoggedEvent], bool]) -> int:
    log, out = _existing(arguments.log), absolute(arguments.out)
    if not out.parent.is_dir() or out.is_dir() or (out.exists() and out.samefile(log)):
        raise UserError(f"{out} can't be written: name another file in a folder that exists.")
    num_read = 0

    def chosen() -> Iterator[LoggedEvent]:
        nonlocal num_read
        for event in read_log(log):
            num_read += 1
            if is_wanted(event):
                yield event

    num_written = write_log(out, chosen())
    print(f"{num_written:,} of {num_read:,} messages are in {out}")
    return 0


def export(arguments: Namespace) -> int:
    """One file of JSON lines for each channel: the event's time and the message's fields."""
    log, folder = _existing(arguments.log), absolute(arguments.folder)
    folder.mkdir(parents=True, exist_ok=True)
    channels: dict[str, list[str]] = {}
    num_unknown = 0
    for event in read_log(log):
        if arguments.channels and not _is_named(event.channel, arguments.channels):
            continue
        message = receive_logged(event.data)
        if message is None:
            num_unknown += 1
            continue
        row = {"time_us": event.time_us, **_to_json(message)}
        channels.setdefault(event.channel, []).append(json.dumps(row))
    for name, rows in channels.items():
        path = folder / f"{re.sub(r'[^A-Za-z0-9_.-]', '_', name)}.jsonl"
        with replacing(path) as written:
            written.write_text("\n".join(rows) + "\n")
    print(f"{sum(map(len, channels.values())):,} messages of {len(channels)} channels are in {folder}")
    if num_unknown:
        print(f"{num_unknown:,} messages are of no type of Tessera's")
    return 0


def _to_json(value: Any) -> Any:
    """Fields of messages by name; bytes in base64."""
    if hasattr(value, "__slots__"):
        return {name: _to_json(getattr(value, name)) for name in value.__slots__}
    if isinstance(value, list | tuple):
        return [_to_json(each) for each in value]
    return base64.b64encode(value).decode() if isinstance(value, bytes) else value


def _existing(text: str) -> Path:
    path = absolute(text)
    if not path.is_file():
        raise UserError(f"there is no log {path}.")
    return path


def _megabytes(path: Path) -> str:
    return f"{1e-6 * path.stat().st_size:.1f} MB"
