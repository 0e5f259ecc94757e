"""The grammar of .pmd files, that of libbot's procman, read into a tree. What the names mean is decided elsewhere.

  file      := { block }
  block     := WORD [ STRING ] "{" { block | attribute | step } "}"
  attribute := WORD "=" ( STRING | WORD ) ";"
  step      := { WORD | STRING } ";"

"#" begins a comment. Every node of the tree knows its line and column, so that whoever finds a fault can say where.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

from tessera_cli.errors import UserError

# A process list of a hundred nodes is some tens of kilobytes; more is not a process list.
MAX_FILE_BYTES = 1_000_000
MAX_DEPTH = 20
TOKEN = re.compile(
    r"""(?P<blank>[ \t\r\n]+|\#[^\n]*)
                     |(?P<string>"(?:[^"\\\n]|\\["\\])*")
                     |(?P<word>[A-Za-z0-9_.:/+-]+)
                     |(?P<mark>[{}=;])""",
    re.VERBOSE,
)


@dataclass(frozen=True)
class Place:
    path: Path
    line: int
    column: int

    def error(self, sentence: str) -> UserError:
        return UserError(f"{self.path}:{self.line}:{self.column}: {sentence}")


@dataclass(frozen=True)
class Token:
    kind: str  # string, word, mark or end
    text: str  # of a string: without quotes and escapes
    place: Place

    def __str__(self) -> str:
        return "the end of the file" if self.kind == "end" else f"'{self.text}'"


@dataclass(frozen=True)
class Attribute:
    name: str
    value: str
    place: Place


@dataclass(frozen=True)
class Step:
    words: list[Token]
    place: Place


@dataclass
class Block:
    kind: str
    name: str
    place: Place
    blocks: list["Block"] = field(default_factory=list)
    attributes: list[Attribute] = field(default_factory=list)
    steps: list[Step] = field(default_factory=list)


def read_blocks(path: Path) -> list[Block]:
    """The outermost blocks of a file. Raises UserError with file, line and column of the first fault."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"the process list {path} can't be read: {error.strerror}.") from error
    if len(data) > MAX_FILE_BYTES:
        raise UserError(f"{path} has {len(data)} bytes; that is no process list.")
    try:
        text = data.decode()
    except UnicodeDecodeError as error:
        raise UserError(f"{path} is no text: byte {error.start} is not UTF-8.") from error
    return _Parser(_tokens(text, path)).blocks()


def _tokens(text: str, path: Path) -> list[Token]:
    tokens, position, line, line_start = [], 0, 1, 0
    while position < len(text):
        place = Place(path, line, position - line_start + 1)
        match = TOKEN.match(text, position)
        if not match:
            what = (
                "this string does not end on its line"
                if text[position] == '"'
                else f"'{text[position]}' means nothing here"
            )
            raise place.error(f"{what}.")
        if match.lastgroup == "string":
            tokens.append(Token("string", re.sub(r'\\(["\\])', r"\1", match[0][1:-1]), place))
        elif match.lastgroup != "blank":
            tokens.append(Token(match.lastgroup, match[0], place))
        if newlines := match[0].count("\n"):
            line += newlines
            line_start = position + match[0].rindex("\n") + 1
        position = match.end()
    tokens.append(Token("end", "", Place(path, line, position - line_start + 1)))
    return tokens


class _Parser:
    def __init__(self, tokens: list[Token]) -> None:
        self._tokens = tokens
        self._next = 0

    def blocks(self) -> list[Block]:
        found = []
        while self._peek().kind != "end":
            found.append(self._block(self._take("word", "a block such as cmd, group or script"), depth=1))
        return found

    def _block(self, kind: Token, depth: int) -> Block:
        if depth > MAX_DEPTH:
            raise kind.place.error(f"blocks are nested deeper than {MAX_DEPTH}.")
        name = self._take("string", "").text if self._peek().kind == "string" else ""
        self._take_mark("{", f"'{kind.text}' is a block and needs '{{'")
        block = Block(kind.text, name, kind.place)
        while not self._at_mark("}"):
            self._content(block, kind, depth)
        self._next += 1
        return block

    def _content(self, block: Block, kind: Token, depth: int) -> None:
        if self._peek().kind == "end":
            raise self._peek().place.error(f"'}}' is missing: '{kind.text}' of line {kind.place.line} is still open.")
        first = self._take("word", "a name")
        follower = self._tokens[self._next + (self._peek().kind == "string")]
        if self._at_mark("="):
            self._next += 1
            value = self._take_value(first)
            self._take_mark(";", f"'{first.text} = ...' must end with ';'")
            block.attributes.append(Attribute(first.text, value.text, first.place))
        elif follower.kind == "mark" and follower.text == "{":
            block.blocks.append(self._block(first, depth + 1))
        else:
            block.steps.append(self._step(first))

    def _step(self, first: Token) -> Step:
        words = [first]
        while self._peek().kind in ("word", "string"):
            words.append(self._tokens[self._next])
            self._next += 1
        self._take_mark(";", f"'{first.text} ...' must end with ';'")
        return Step(words, first.place)

    def _peek(self) -> Token:
        return self._tokens[self._next]

    def _at_mark(self, text: str) -> bool:
        return self._peek().kind == "mark" and self._peek().text == text

    def _take(self, kind: str, what: str) -> Token:
        token = self._peek()
        if token.kind != kind:
            raise token.place.error(f"here should stand {what}, not {token}.")
        self._next += 1
        return token

    def _take_value(self, name: Token) -> Token:
        token = self._peek()
        if token.kind not in ("string", "word"):
            raise token.place.error(f"'{name.text} =' needs a value, not {token}.")
        self._next += 1
        return token

    def _take_mark(self, text: str, sentence: str) -> None:
        if not self._at_mark(text):
            raise self._peek().place.error(f"{sentence}, not {self._peek()}.")
        self._next += 1
