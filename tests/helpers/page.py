"""A page as a browser would read it, but strictly."""

from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path

VOID = {"meta", "wbr", "link", "br", "hr", "img", "input"}


@dataclass
class Element:
    tag: str
    attributes: dict
    children: list = field(default_factory=list)
    text: str = ""

    def all(self, tag: str) -> list["Element"]:
        return ([self] if self.tag == tag else []) + [found for child in self.children for found in child.all(tag)]

    def words(self) -> str:
        return " ".join([self.text, *(child.words() for child in self.children)])


class Page(HTMLParser):
    """Fails where a browser would have to guess: every element must be closed by its own tag, in order."""

    def __init__(self, path: Path) -> None:
        super().__init__(convert_charrefs=True)
        self.root = Element("", {})
        self._open = [self.root]
        self.source = path.read_text()
        self.feed(self.source)
        self.close()
        assert [element.tag for element in self._open] == [""], "unclosed"

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        assert len(dict(attributes)) == len(attributes), f"<{tag}> has an attribute twice"
        element = Element(tag, dict(attributes))
        self._open[-1].children.append(element)
        if tag not in VOID:
            self._open.append(element)

    def handle_startendtag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self._open[-1].children.append(Element(tag, dict(attributes)))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop().tag == tag, f"</{tag}> at line {self.getpos()[0]} closes another element"

    def handle_data(self, data: str) -> None:
        self._open[-1].text += data

    def every(self) -> list[Element]:
        found, rest = [], [self.root]
        while rest:
            element = rest.pop()
            found.append(element)
            rest += element.children
        return found
