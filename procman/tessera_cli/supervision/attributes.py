"""The attributes of a cmd in a process list: their meaning, their defaults, and how each is read and checked."""

import re
import signal
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from tessera_cli.constants import MAX_INSTANCES
from tessera_cli.supervision.pmd_syntax import Attribute, Block

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,47}")
HOST = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
RESPAWN = {
    "always": "always",
    "failure": "failure",
    "killed": "killed",
    "never": "never",
    "true": "always",
    "false": "never",
}

# Reads the text of an attribute's value. Raises ValueError whose text continues a sentence that begins with "it".
Reader = Callable[[str], Any]


@dataclass(frozen=True)
class RunOptions:
    """How a process runs. All values are checked where they are read."""

    # Ready when its stage reports RUNNING on STATUS, or, if "started", when it has existed for a moment.
    ready: str = "status"
    # A process that is not ready in time is ended, which counts as a failure. LCM's self-test alone takes up to 10 s.
    ready_timeout_s: float = 30.0
    # A ready process whose stage reports nothing for so long hangs and is killed; 0: never. Stages report at 2 Hz.
    hang_timeout_s: float = 15.0
    # Restarted: always, after a failure (a status other than 0 and 2), only when killed by a signal, or never.
    auto_respawn: str = "failure"
    nice: int = 0  # added to the deputy's own
    cpus: tuple[int, ...] = ()  # that it may run on; empty: all
    memory_limit_mb: float = 0.0  # 10^6 bytes of the whole process tree; above, it is killed; 0: no limit
    stop_signal: int = signal.SIGTERM
    stop_time_allowed: float = 5.0  # s from that signal to SIGKILL


def number(minimum: float, maximum: float, kind: type[int] | type[float] = float) -> Reader:
    """A reader of numbers in a range."""

    def parse(text: str) -> int | float:
        pattern = r"-?\d{1,9}(\.\d{1,6})?" if kind is float else r"-?\d{1,9}"
        if not re.fullmatch(pattern, text) or not minimum <= float(text) <= maximum:
            raise ValueError(f"must be a {'whole ' if kind is int else ''}number from {minimum} to {maximum}")
        return kind(text)

    return parse


def names(pattern: re.Pattern[str], meaning: str) -> Reader:
    """A reader of several names, separated by commas or blanks."""

    def parse(text: str) -> tuple[str, ...]:
        found = tuple(text.replace(",", " ").split())
        if not found or len(set(found)) < len(found) or not all(pattern.fullmatch(name) for name in found):
            raise ValueError(f"must be {meaning}, each once, separated by commas or blanks")
        return found

    return parse


def one_of(choices: Mapping[str, str]) -> Reader:
    """A reader of words, each of which stands for a value."""

    def parse(text: str) -> str:
        if text not in choices:
            raise ValueError(f"must be one of {', '.join(choices)}")
        return choices[text]

    return parse


def parse_cpus(text: str) -> tuple[int, ...]:
    """`0,2-3` as (0, 2, 3)."""
    cpus: set[int] = set()
    for part in text.replace(" ", "").split(","):
        match = re.fullmatch(r"(\d{1,4})(?:-(\d{1,4}))?", part)
        if not match or int(match[2] or match[1]) < int(match[1]):
            raise ValueError("must be numbers of CPUs such as 0,2-3")
        cpus.update(range(int(match[1]), int(match[2] or match[1]) + 1))
    return tuple(sorted(cpus))


def parse_signal(text: str) -> int:
    try:
        return int(signal.Signals(int(text)) if text.isdecimal() else signal.Signals["SIG" + text.removeprefix("SIG")])
    except (ValueError, KeyError):
        raise ValueError("must be a signal such as SIGINT or 2") from None


# Attributes of a cmd that are fields of RunOptions.
OPTIONS: dict[str, Reader] = {
    "ready": one_of({"status": "status", "started": "started"}),
    "ready_timeout_s": number(0.1, 3600),
    "hang_timeout_s": number(0, 86400),
    "auto_respawn": one_of(RESPAWN),
    "nice": number(-20, 19, int),
    "cpus": parse_cpus,
    "memory_limit_mb": number(0, 100_000_000),
    "stop_signal": parse_signal,
    "stop_time_allowed": number(0, 600),
}
ATTRIBUTES: dict[str, Reader] = {
    "exec": names(NAME, "the name of one command of the deputy's list"),
    "host": names(HOST, "ids of deputies"),
    "count": number(0, MAX_INSTANCES, int),
    "depends": names(NAME, "names of commands or groups"),
    **OPTIONS,
}
# Attributes of a deputy's own command list; a process list must not decide about them.
ONLY_LOCAL = ("folder", "environment", "writes")


def read_attribute(attribute: Attribute, readers: Mapping[str, Reader]) -> Any:
    """The value of one attribute. Raises UserError with its place."""
    if attribute.name in ONLY_LOCAL and attribute.name not in readers:
        raise attribute.place.error(
            f"'{attribute.name}' belongs to the deputy's own command list, not to a process list."
        )
    if attribute.name not in readers:
        raise attribute.place.error(f"there is no attribute '{attribute.name}'; known: {', '.join(sorted(readers))}.")
    try:
        return readers[attribute.name](attribute.value)
    except ValueError as error:
        raise attribute.place.error(f'{attribute.name} = "{attribute.value}": it {error}.') from error


def read_attributes(block: Block, readers: Mapping[str, Reader]) -> dict[str, Any]:
    """The values of all attributes of a block, each of which may be given once."""
    values: dict[str, Any] = {}
    for attribute in block.attributes:
        if attribute.name in values:
            raise attribute.place.error(f"'{attribute.name}' is given twice.")
        values[attribute.name] = read_attribute(attribute, readers)
    return values
