"""The attributes of a cmd in a process list: their meaning, defaults, and how each is read and checked."""

import re
import signal
from collections.abc import Callable
from dataclasses import dataclass

from tessera_cli.supervision.pmd_syntax import Attribute, Block

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,47}")
HOST = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
MAX_INSTANCES = 256  # extractors that a dispatcher takes
RESPAWN = {
    "always": "always",
    "failure": "failure",
    "killed": "killed",
    "never": "never",
    "true": "always",
    "false": "never",
}


@dataclass(frozen=True)
class RunOptions:
    """How a process runs. All values are checked where they are read."""

    ready: str = "status"  # ready when its stage status says RUNNING; "started": when it exists for a moment
    ready_timeout_s: float = (
        30.0  # one that is not ready by then is ended and counts as died; LCM's self-test alone takes up to 10 s
    )
    hang_timeout_s: float = (
        15.0  # a ready one without a stage status for so long hangs and is killed; 0: never. They come at 2 Hz
    )
    auto_respawn: str = (
        "failure"  # started again: always, after failure (not status 0 or 2), only when killed by a signal, never
    )
    nice: int = 0  # added to the deputy's own
    cpus: tuple[int, ...] = ()  # that it may run on; empty: all
    memory_limit_mb: float = 0.0  # 10^6 bytes of the whole tree; above, it is killed; 0: no limit
    stop_signal: int = signal.SIGTERM
    stop_time_allowed: float = 5.0  # s from that signal to SIGKILL


def number(minimum: float, maximum: float, kind: type = float) -> Callable[[str], float]:
    def parse(text: str):
        if (
            not re.fullmatch(r"-?\d{1,9}(\.\d{1,6})?" if kind is float else r"-?\d{1,9}", text)
            or not minimum <= float(text) <= maximum
        ):
            raise ValueError(f"must be a {'whole ' if kind is int else ''}number from {minimum} to {maximum}")
        return kind(text)

    return parse


def words(pattern: re.Pattern, what: str) -> Callable[[str], tuple[str, ...]]:
    def parse(text: str) -> tuple[str, ...]:
        found = tuple(text.replace(",", " ").split())
        if not found or len(set(found)) < len(found) or not all(pattern.fullmatch(word) for word in found):
            raise ValueError(f"must be {what}, each once, with commas or blanks between them")
        return found

    return parse


def one_of(choices: dict[str, str]) -> Callable[[str], str]:
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


# Attributes of a cmd that are fields of RunOptions, and how they are read.
OPTIONS: dict[str, Callable] = {
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
ATTRIBUTES: dict[str, Callable] = {
    "exec": words(NAME, "the name of one command of the deputy's list"),
    "host": words(HOST, "ids of deputies"),
    "count": number(0, MAX_INSTANCES, int),
    "depends": words(NAME, "names of commands or groups"),
    **OPTIONS,
}
ONLY_LOCAL = ("folder", "environment")


def read_attribute(attribute: Attribute, readers: dict[str, Callable]):
    if attribute.name in ONLY_LOCAL and attribute.name not in readers:
        raise attribute.place.error(f"'{attribute.name}' is said in the deputy's own command list, not by who orders.")
    if attribute.name not in readers:
        raise attribute.place.error(f"there is no attribute '{attribute.name}'; known: {', '.join(sorted(readers))}.")
    try:
        return readers[attribute.name](attribute.value)
    except ValueError as error:
        raise attribute.place.error(f'{attribute.name} = "{attribute.value}": it {error}.') from error


def read_attributes(block: Block, readers: dict[str, Callable]) -> dict:
    values = {}
    for attribute in block.attributes:
        if attribute.name in values:
            raise attribute.place.error(f"'{attribute.name}' is given twice.")
        values[attribute.name] = read_attribute(attribute, readers)
    return values
