"""The argument parser of all commands, and types of arguments whose errors are one sentence each."""

import argparse
import re
from collections.abc import Callable
from typing import NoReturn, TypeAlias

# What subcommands are added to.
Commands: TypeAlias = "argparse._SubParsersAction[Parser]"
# Carries out a command and returns its exit status.
Main = Callable[[argparse.Namespace], int]
SENSORS = ("mono", "stereo", "rgbd")


class Parser(argparse.ArgumentParser):
    """Says what is wrong in one sentence instead of printing the whole usage."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"tessera: {message.removeprefix('argument ')}; {self.prog} --help explains the arguments.\n")


def add_command(commands: Commands, name: str, main: Main, summary: str, epilog: str = "") -> Parser:
    """A subcommand. `epilog` ends its help, with examples."""
    parser = _add_parser(commands, name, summary, epilog)
    parser.set_defaults(main=main)
    return parser


def add_group(commands: Commands, name: str, summary: str, epilog: str) -> Commands:
    """A subcommand that has subcommands of its own, which are added to what is returned."""
    parser = _add_parser(commands, name, summary, epilog)
    return parser.add_subparsers(metavar="NAME", required=True, parser_class=Parser)


def _add_parser(commands: Commands, name: str, summary: str, epilog: str) -> Parser:
    return commands.add_parser(
        name,
        help=summary,
        description=summary,
        epilog=epilog,
        allow_abbrev=False,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def whole_number(minimum: int, maximum: int) -> Callable[[str], int]:
    def parse(text: str) -> int:
        if not re.fullmatch(r"-?\d{1,9}", text) or not minimum <= int(text) <= maximum:
            raise argparse.ArgumentTypeError(f"must be a whole number from {minimum} to {maximum}, not '{text}'")
        return int(text)

    return parse


def seconds(text: str) -> float:
    if not re.fullmatch(r"\d{1,6}(\.\d+)?", text) or float(text) <= 0:
        raise argparse.ArgumentTypeError(f"must be a number of seconds above 0, not '{text}'")
    return float(text)


def tiles(text: str) -> str:
    """LINESxCOLUMNS without leading zeros."""
    if not re.fullmatch(r"0*[1-9]\d{0,2}x0*[1-9]\d{0,2}", text):
        raise argparse.ArgumentTypeError(f"must be LINESxCOLUMNS, both at least 1, such as 2x4, not '{text}'")
    return "x".join(str(int(part)) for part in text.split("x"))


def pace(text: str) -> str:
    if text in ("lockstep", "realtime"):
        return text
    if re.fullmatch(r"\d+(\.\d+)?|\.\d+", text) and float(text) > 0:
        return str(float(text))
    raise argparse.ArgumentTypeError(f"must be lockstep, realtime or a speed factor such as 0.5, not '{text}'")


def frames(text: str) -> tuple[int, int]:
    """`A:B` as (first, last), `last` exclusive and -1 where it is left out."""
    match = re.fullmatch(r"(\d{0,9}):(\d{0,9})", text)
    if not match:
        raise argparse.ArgumentTypeError(f"must be A:B, the first frame and the one after the last, not '{text}'")
    first, last = int(match[1] or 0), int(match[2]) if match[2] else -1
    if last != -1 and last <= first:
        raise argparse.ArgumentTypeError(f"holds no frame: '{text}' must have A < B")
    return first, last


def second_of(text: str) -> float:
    """A moment, counted from a beginning."""
    if not re.fullmatch(r"\d{1,9}(\.\d{1,9})?", text):
        raise argparse.ArgumentTypeError(f"must be a number of seconds, not '{text}'")
    return float(text)


def sensor_and_source(text: str) -> tuple[str, str]:
    """`[SENSOR=]SOURCE` as (sensor, source); a source may hold `=` too."""
    sensor, equals, source = text.partition("=")
    if not equals or ":" in sensor:
        return "mono", text
    if sensor not in SENSORS:
        raise argparse.ArgumentTypeError(f"'{sensor}' in '{text}' must be one of {', '.join(SENSORS)}")
    return sensor, source


def command_count(text: str) -> tuple[str, int]:
    """`CMD=NUMBER`."""
    name, equals, number = text.partition("=")
    if not name or not equals or not re.fullmatch(r"\d{1,3}", number):
        raise argparse.ArgumentTypeError(f"'{text}' is not CMD=NUMBER, such as extractor=4")
    return name, int(number)


def assignment(text: str) -> str:
    if not re.fullmatch(r"[^=]+=.*", text, re.DOTALL):
        raise argparse.ArgumentTypeError(f"must be section.key=value, not '{text}'")
    return text
