"""Between the processes of a list and the wishes of an order, and what a deputy launches for a wish."""

import hashlib
from collections.abc import Mapping
from dataclasses import fields

from tessera_cli.constants import MAX_INSTANCES
from tessera_cli.errors import UserError
from tessera_cli.messages import procman_wish_t
from tessera_cli.supervision.attributes import NAME, OPTIONS, RunOptions
from tessera_cli.supervision.child_process import Launch
from tessera_cli.supervision.command_list import LocalCommand
from tessera_cli.supervision.process_list import Process
from tessera_cli.supervision.process_names import full_name


def run_of(settings: list[str], secret: bytes | None) -> str:
    """A digest of settings and secret that names a run: deputies of one run wait for each other's processes."""
    words = [*settings, hashlib.sha256(secret).hexdigest() if secret else ""]
    return hashlib.sha256("\n".join(words).encode()).hexdigest()[:16]


def to_wish(process: Process) -> procman_wish_t:
    """A process as an order asks for it."""
    wish = procman_wish_t()
    wish.name, wish.command, wish.instance = process.name, process.command, process.instance
    for option in fields(RunOptions):
        setattr(wish, option.name, getattr(process.options, option.name))
    wish.num_cpus, wish.num_depends, wish.depends = len(wish.cpus), len(process.depends), list(process.depends)
    return wish


def to_launch(
    wish: procman_wish_t,
    commands: Mapping[str, LocalCommand],
    values: Mapping[str, str],
    run: str,
    generation: int,
    list_name: str = "",
) -> Launch:
    """What a deputy executes for a wish.

    `values`: of the placeholders, except the process's own. `list_name`: empty where there is only one list.
    Raises UserError for a wish that can't be granted.
    """
    if not NAME.fullmatch(wish.name) or not 0 <= wish.instance < MAX_INSTANCES:
        raise UserError(f"'{wish.name}' with number {wish.instance} is no valid name and number of a process.")
    command = commands.get(wish.command)
    if command is None:
        raise UserError(f"'{wish.command}' is not in this deputy's command list, which has: {', '.join(commands)}.")
    words = command.fill({**values, "name": wish.name, "id": str(wish.instance)})
    return Launch(
        words=tuple(words),
        held=command.held,
        folder=command.folder,
        environment=tuple(command.environment.items()),
        command=wish.command,
        depends=tuple(full_name(list_name, name) for name in wish.depends),
        options=_options(wish),
        run=run,
        generation=generation,
    )


def _options(wish: procman_wish_t) -> RunOptions:
    values = {option.name: getattr(wish, option.name) for option in fields(RunOptions)}
    values["cpus"] = tuple(wish.cpus)
    for name, value in values.items():
        text = ",".join(map(str, value)) if name == "cpus" else f"{value:g}" if isinstance(value, float) else str(value)
        try:
            if text:
                OPTIONS[name](text)
        except ValueError as error:
            raise UserError(f"{wish.name}: {name} = {text}: it {error}.") from error
    return RunOptions(**values)
