"""A deputy's own list of what it executes: orders select from it by name, and nothing else is ever executed.

It has the grammar of process lists, with other attributes: exec (the program and its arguments), folder,
environment, writes (folders in which the settings of orders may let processes write, besides the run's own), and held
(the argument with which the program prepares itself and begins when its standard input ends).
In exec, ${bin}, ${settings}, ${name} and ${id} stand for the folder of the built programs, the run's file of settings,
and the process's name and number. Words are split before they are filled in, so that no value becomes two arguments.
"""

import re
import shlex
from dataclasses import dataclass, field
from pathlib import Path

from tessera_cli.errors import UserError
from tessera_cli.files import PROCMAN, ROOT
from tessera_cli.supervision.attributes import read_attributes
from tessera_cli.supervision.pmd_syntax import Block, read_blocks, refuse
from tessera_cli.supervision.process_list import require_name

SHIPPED_LIST = PROCMAN / "commands.pmd"
PLACEHOLDER = re.compile(r"\$\{([^}]*)\}")
PLACEHOLDERS = ("bin", "settings", "name", "id")


@dataclass(frozen=True)
class LocalCommand:
    """One entry of the list."""

    name: str
    words: tuple[str, ...]  # program and arguments, with placeholders
    folder: Path  # working folder
    environment: dict[str, str] = field(default_factory=dict)  # added to the deputy's own
    writes: tuple[Path, ...] = ()  # folders in which an order's settings may let it write (write_limits.py)
    held: str = ""  # the argument that makes it wait until its input ends; empty: it can't

    def fill(self, values: dict[str, str]) -> list[str]:
        """The words to execute. `values`: of all placeholders."""
        return [PLACEHOLDER.sub(lambda match: values[match[1]], word) for word in self.words]


def read_command_list(path: Path, folder: Path = ROOT) -> dict[str, LocalCommand]:
    """The commands by name. `folder`: working folder of commands for which the list names none.

    Raises UserError with file, line and column of the first error.
    """
    commands: dict[str, LocalCommand] = {}
    for block in read_blocks(path):
        command = _read_command(block, folder)
        if command.name in commands:
            raise block.place.error(f'there are two commands "{command.name}".')
        commands[command.name] = command
    if not commands:
        raise UserError(f'{path} lists no command: it needs a block cmd "NAME" {{ exec = "PROGRAM ARGUMENTS"; }}.')
    return commands


def _read_command(block: Block, folder: Path) -> LocalCommand:
    if block.kind != "cmd":
        raise block.place.error(f"a command list holds only cmd, not '{block.kind}'.")
    refuse([*block.blocks, *block.steps], 'a cmd holds only attributes such as exec = "PROGRAM ARGUMENTS";.')
    readers = {
        "exec": _read_words,
        "folder": _read_folder,
        "environment": _read_environment,
        "writes": _read_folders,
        "held": _read_argument,
    }
    values = read_attributes(block, readers)
    if "exec" not in values:
        raise block.place.error(f'cmd "{block.name}" has no exec.')
    words = values.pop("exec")
    return LocalCommand(require_name(block), words, **{"folder": folder, **values})


def _read_words(text: str) -> tuple[str, ...]:
    words = tuple(shlex.split(text))
    if not words:
        raise ValueError("must name a program")
    for name in PLACEHOLDER.findall(text):
        if name not in PLACEHOLDERS:
            raise ValueError(f"has an unknown ${{{name}}}; known: {', '.join(PLACEHOLDERS)}")
    return words


def _read_argument(text: str) -> str:
    if not re.fullmatch(r"-[\w-]+", text):
        raise ValueError("must be one argument such as --held")
    return text


def _read_folder(text: str) -> Path:
    folder = Path(text).expanduser()
    return folder if folder.is_absolute() else ROOT / folder


def _read_folders(text: str) -> tuple[Path, ...]:
    return tuple(_read_folder(word) for word in shlex.split(text))


def _read_environment(text: str) -> dict[str, str]:
    pairs = [word.partition("=") for word in shlex.split(text)]
    if not all(re.fullmatch(r"[A-Za-z_]\w*", name) and equals for name, equals, _ in pairs):
        raise ValueError("must be NAME=VALUE, separated by blanks")
    return {name: value for name, _, value in pairs}
