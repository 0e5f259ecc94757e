"""The grammar of .pmd files, that of libbot's procman, parsed into a tree by lark.

What the names in the tree mean is decided by process_list.py and command_list.py. Every node knows its line and column,
so that whoever finds an error can say where it is.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from lark import Lark, Token, Transformer, UnexpectedCharacters, UnexpectedInput, UnexpectedToken, v_args

from tessera_cli.constants import MAX_LIST_BYTES
from tessera_cli.errors import UserError

GRAMMAR = r"""
    start: block*
    block: WORD STRING? "{" (block | attribute | step)* "}"
    attribute: WORD "=" (STRING | WORD) ";"
    step: WORD (WORD | STRING)* ";"

    STRING: /"(?:[^"\\\n]|\\["\\])*"/
    WORD: /[A-Za-z0-9_.:\/+-]+/
    COMMENT: /#[^\n]*/
    BLANK: /[ \t\r\n]+/
    %ignore COMMENT
    %ignore BLANK
"""
MAX_DEPTH = 20
# Lark's names of the tokens that may be expected, for people.
TOKEN_NAMES = {
    "WORD": "a name",
    "STRING": "a text in quotes",
    "LBRACE": "'{'",
    "RBRACE": "'}'",
    "EQUAL": "'='",
    "SEMICOLON": "';'",
    "$END": "the end of the file",
}


@dataclass(frozen=True)
class Place:
    """A position in a file; lines and columns are counted from 1."""

    path: Path
    line: int
    column: int

    def error(self, sentence: str) -> UserError:
        return UserError(f"{self.path}:{self.line}:{self.column}: {sentence}")


@dataclass(frozen=True)
class Word:
    """A word or a text in quotes, without the quotes."""

    text: str
    place: Place


@dataclass(frozen=True)
class Attribute:
    """NAME = VALUE;"""

    name: str
    value: str
    place: Place


@dataclass(frozen=True)
class Step:
    """WORD WORD ...;"""

    words: list[Word]
    place: Place


@dataclass
class Block:
    """KIND "NAME" { ... }; the name may be empty."""

    kind: str
    name: str
    place: Place
    blocks: list["Block"] = field(default_factory=list)
    attributes: list[Attribute] = field(default_factory=list)
    steps: list[Step] = field(default_factory=list)
    depth: int = 1  # 1 + that of the deepest block within


class Placed(Protocol):
    """Any node of the tree."""

    @property
    def place(self) -> Place: ...


def refuse(nodes: Sequence[Placed], sentence: str) -> None:
    """Raises UserError at the first of these nodes, if there is any."""
    if nodes:
        raise nodes[0].place.error(sentence)


def read_blocks(path: Path) -> list[Block]:
    """The outermost blocks of a file. Raises UserError with file, line and column of the first error."""
    text = _read_text(path)
    try:
        blocks: list[Block] = Lark(GRAMMAR, parser="lalr", transformer=_TreeBuilder(path)).parse(text)  # type: ignore[assignment]
    except UnexpectedInput as error:
        raise _explain(error, text, path) from error
    for block in blocks:
        if block.depth > MAX_DEPTH:
            raise block.place.error(f"blocks are nested deeper than {MAX_DEPTH}.")
    return blocks


def _read_text(path: Path) -> str:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"the process list {path} can't be read: {error.strerror}.") from error
    if len(data) > MAX_LIST_BYTES:
        raise UserError(f"{path} has {len(data)} bytes, which is too large for a process list.")
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise UserError(f"{path} is not a text file: byte {error.start} is not UTF-8.") from error


@v_args(inline=True)
class _TreeBuilder(Transformer[Token, list[Block]]):
    """Called by the parser with the parts of each rule, the innermost rule first."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path

    def start(self, *blocks: Block) -> list[Block]:
        return list(blocks)

    def block(self, kind: Word, *content: Word | Block | Attribute | Step) -> Block:
        block = Block(kind.text, "", kind.place)
        for part in content:
            match part:
                case Word():
                    block.name = part.text
                case Block():
                    block.blocks.append(part)
                case Attribute():
                    block.attributes.append(part)
                case Step():
                    block.steps.append(part)
        block.depth += max((inner.depth for inner in block.blocks), default=0)
        return block

    def attribute(self, name: Word, value: Word) -> Attribute:
        return Attribute(name.text, value.text, name.place)

    def step(self, *words: Word) -> Step:
        return Step(list(words), words[0].place)

    def WORD(self, token: Token) -> Word:  # noqa: N802, lark calls it by the token's name
        return Word(str(token), self._place(token))

    def STRING(self, token: Token) -> Word:  # noqa: N802
        return Word(re.sub(r'\\(["\\])', r"\1", token[1:-1]), self._place(token))

    def _place(self, token: Token) -> Place:
        return Place(self._path, token.line or 0, token.column or 0)


def _explain(error: UnexpectedInput, text: str, path: Path) -> UserError:
    place = Place(path, error.line, error.column)
    if isinstance(error, UnexpectedCharacters):
        is_open_string = error.char == '"'
        return place.error(
            "this string does not end on its line." if is_open_string else f"'{error.char}' is not allowed here."
        )
    assert isinstance(error, UnexpectedToken)
    if error.token.type == "$END":
        return _end_of(text, path).error("a block is still open: its '}' is missing.")
    expected = " or ".join(sorted(TOKEN_NAMES[name] for name in error.accepts or error.expected))
    return place.error(f"expected {expected}, but found '{error.token}'.")


def _end_of(text: str, path: Path) -> Place:
    return Place(path, text.count("\n") + 1, len(text) - (text.rfind("\n") + 1) + 1)
