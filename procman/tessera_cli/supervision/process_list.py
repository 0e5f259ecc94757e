"""What a process list (procman/*.pmd) asks for: which commands run on which nodes, how, and in which scripts.

The list names commands; what a name executes is decided by each deputy's own command list (command_list.py), so that
neither a list nor its sender can make a node execute anything else.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from tessera_cli.constants import MAX_INSTANCES
from tessera_cli.errors import UserError
from tessera_cli.supervision.attributes import ATTRIBUTES, NAME, RunOptions, number, read_attribute, read_attributes
from tessera_cli.supervision.pmd_syntax import Attribute, Block, Place, Word, read_blocks, refuse

SETTING = re.compile(r"[a-z_]+\.[a-z0-9_]+")
DEFAULT_WAIT_S = 60.0


@dataclass(frozen=True)
class Process:
    """One process on one host."""

    name: str  # unique in the list and on the bus: the command's, with _<id> where there are several
    command: str  # name in the deputy's command list
    host: str  # id of the deputy; empty: that of this machine
    instance: int  # 0, 1, ... among the processes of one cmd
    depends: tuple[str, ...]  # names of processes that must be ready before it starts
    options: RunOptions


@dataclass(frozen=True)
class ScriptStep:
    """One step of a script.

    start, stop, restart: `names`. wait: until `names` are `status`, at most `seconds`; without a status: sleep.
    run_script: `script`.
    """

    action: str
    place: Place
    names: tuple[str, ...] = ()
    status: str = ""
    seconds: float = 0.0
    script: str = ""


@dataclass
class ProcessList:
    """The content of a file."""

    path: Path
    processes: dict[str, Process] = field(default_factory=dict)
    settings: list[str] = field(default_factory=list)  # section.key=value
    scripts: dict[str, list[ScriptStep]] = field(default_factory=dict)

    @property
    def hosts(self) -> list[str]:
        return sorted({process.host for process in self.processes.values()})


def require_name(block: Block) -> str:
    """The block's name. Raises UserError if it has none or a bad one."""
    if not NAME.fullmatch(block.name):
        raise block.place.error(
            f'{block.kind} needs a name in quotes, of letters, digits and _, at most 48; it has "{block.name}".'
        )
    return block.name


def read_process_list(path: Path, counts: Mapping[str, int] | None = None) -> ProcessList:
    """`counts`: number of processes on each host, by cmd, instead of what the list says.

    Raises UserError with file, line and column of the first error.
    """
    return _Reader(path, counts or {}).read(read_blocks(path))


class _Reader:
    def __init__(self, path: Path, counts: Mapping[str, int]) -> None:
        self._counts = counts
        self._list = ProcessList(path)
        self._members: dict[str, list[str]] = {}  # processes of each cmd and group
        self._depends: list[tuple[str, Attribute]] = []  # of a cmd, resolved when all names are known

    def read(self, blocks: list[Block]) -> ProcessList:
        for block in blocks:
            if block.kind == "settings":
                self._read_settings(block)
            elif block.kind != "script":
                self._read_member(block)
        if unknown := sorted(set(self._counts) - {block.name for block in _commands(blocks)}):
            raise UserError(f'{self._list.path} has no cmd "{unknown[0]}".')
        if not self._list.processes:
            raise UserError(f'{self._list.path} lists no process: it needs a block cmd "NAME" {{ ... }}.')
        self._resolve_depends()
        for block in blocks:
            if block.kind == "script":
                self._read_script(block)
        self._check_scripts()
        return self._list

    def _read_settings(self, block: Block) -> None:
        refuse([*block.blocks, *block.steps], 'settings holds only section.key = "value";.')
        for attribute in block.attributes:
            if not SETTING.fullmatch(attribute.name):
                raise attribute.place.error(f"'{attribute.name}' is no setting; settings are named section.key.")
            self._list.settings.append(f"{attribute.name}={attribute.value}")

    def _read_member(self, block: Block) -> list[str]:
        """The names of the processes of a cmd or group."""
        if block.kind not in ("cmd", "group"):
            raise block.place.error(f"there is no block '{block.kind}'; known: cmd, group, script, settings.")
        name = require_name(block)
        if name in self._members:
            raise block.place.error(f'the name "{name}" is taken by an earlier block.')
        for step in block.steps:
            raise step.place.error(f"'{step.words[0].text}' is only allowed in a script.")
        self._members[name] = []
        self._members[name] = self._read_group(block) if block.kind == "group" else self._read_command(block)
        return self._members[name]

    def _read_group(self, block: Block) -> list[str]:
        refuse(block.attributes, "a group has no attributes; they belong to its commands.")
        return [name for inner in block.blocks for name in self._read_member(inner)]

    def _read_command(self, block: Block) -> list[str]:
        refuse(block.blocks, "a cmd holds no blocks.")
        values = read_attributes(block, ATTRIBUTES)
        hosts, listed_count = values.pop("host", ("",)), values.pop("count", None)
        count = self._counts.get(block.name, 1 if listed_count is None else listed_count)
        commands = values.pop("exec", (block.name,))
        if len(commands) != 1:
            raise block.place.error("exec must name one command of the deputy's list.")
        values.pop("depends", None)
        self._depends += [(block.name, attribute) for attribute in block.attributes if attribute.name == "depends"]
        is_numbered = bool(listed_count) or count > 1 or len(hosts) > 1
        if len(hosts) * count > MAX_INSTANCES:
            raise block.place.error(f"{len(hosts)} hosts with {count} each are more than {MAX_INSTANCES} processes.")
        names = []
        for instance in range(len(hosts) * count):
            name = f"{block.name}_{instance}" if is_numbered else block.name
            if name in self._list.processes:
                raise block.place.error(f'two processes would be named "{name}".')
            host = hosts[instance // count]
            self._list.processes[name] = Process(name, commands[0], host, instance, (), RunOptions(**values))
            names.append(name)
        return names

    def _names(self, word: str, place: Place) -> list[str]:
        if word in self._members:
            return self._members[word]
        if word in self._list.processes:
            return [word]
        raise place.error(f'there is no cmd or group "{word}".')

    def _resolve_depends(self) -> None:
        depends: dict[str, tuple[str, ...]] = {}
        places: dict[str, Place] = {}
        for command, attribute in self._depends:
            words = read_attribute(attribute, ATTRIBUTES)
            found = [name for word in words for name in self._names(word, attribute.place)]
            for name in self._members[command]:
                depends[name] = tuple(dict.fromkeys(found))
                places[name] = attribute.place
        for name, place in places.items():
            if cycle := _find_cycle(name, depends):
                raise place.error(f"{' depends on '.join(cycle)}: none of them could ever start.")
        for name, names in depends.items():
            self._list.processes[name] = replace(self._list.processes[name], depends=names)

    def _read_script(self, block: Block) -> None:
        name = require_name(block)
        if name in self._list.scripts:
            raise block.place.error(f'there are two scripts "{name}".')
        refuse([*block.blocks, *block.attributes], 'a script holds only steps such as start cmd "NAME";.')
        self._list.scripts[name] = [self._read_step(step.words, step.place) for step in block.steps]

    def _read_step(self, words: list[Word], place: Place) -> ScriptStep:
        texts = [word.text for word in words]
        match texts:
            case ["start" | "stop" | "restart" as action, "cmd" | "group", name]:
                return ScriptStep(action, place, tuple(self._names(name, words[2].place)))
            case ["run_script", name]:
                return ScriptStep("run_script", place, script=name)
            case ["wait", "ms", milliseconds]:
                return ScriptStep("wait", place, seconds=_read_number(milliseconds, words[2].place) / 1000)
            case ["wait", "cmd" | "group", name, "status", "ready" | "running" | "finished" | "stopped" as status, *_]:
                names = tuple(self._names(name, words[2].place))
                # libbot's word for a process that exists is "running"; one that merely exists is of no use here.
                status = "ready" if status == "running" else status
                return ScriptStep("wait", place, names, status, _read_timeout(words[5:]))
        raise place.error(
            f"'{' '.join(texts)}' is no step; known: start|stop|restart cmd|group \"NAME\"; wait ms N; "
            'wait cmd|group "NAME" status "ready|finished|stopped" [timeout SECONDS]; run_script "NAME".'
        )

    def _check_scripts(self) -> None:
        calls = {}
        for name, steps in self._list.scripts.items():
            calls[name] = tuple(step.script for step in steps if step.action == "run_script")
            for step in steps:
                if step.script and step.script not in self._list.scripts:
                    raise step.place.error(f'there is no script "{step.script}".')
        for name, steps in self._list.scripts.items():
            if steps and (cycle := _find_cycle(name, calls)):
                raise steps[0].place.error(f"script {' runs '.join(cycle)}, without end.")


def _commands(blocks: list[Block]) -> list[Block]:
    """All blocks of kind cmd, also those in groups."""
    return [block for block in blocks if block.kind == "cmd"] + [
        inner for block in blocks for inner in _commands(block.blocks)
    ]


def _read_timeout(words: list[Word]) -> float:
    """Of `timeout SECONDS`, or the default if there are no words."""
    if not words:
        return DEFAULT_WAIT_S
    if len(words) != 2 or words[0].text != "timeout":
        raise words[0].place.error(f"'{words[0].text}' should be: timeout SECONDS;.")
    return _read_number(words[1].text, words[1].place)


def _read_number(text: str, place: Place) -> float:
    try:
        return number(0, 86_400_000)(text)
    except ValueError as error:
        raise place.error(f"'{text}' {error}.") from error


def _find_cycle(start: str, edges: Mapping[str, tuple[str, ...]]) -> list[str]:
    """Names along the edges from `start` back to itself, empty if there is no such path."""
    paths, seen = [[start]], set()
    while paths:
        path = paths.pop()
        for name in edges.get(path[-1], ()):
            if name == start:
                return [*path, name]
            if name not in seen:
                seen.add(name)
                paths.append([*path, name])
    return []
