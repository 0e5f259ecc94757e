"""Text that others wrote (on the bus, in logs and files), made harmless where it enters.

A terminal obeys control characters, and format characters reorder what people read, in a browser too. They become
visible escapes such as \\x1b and \\u202e.
"""

from typing import Any


def visible(text: str) -> str:
    """One line: its line feeds become visible too."""
    return text if text.isprintable() else "".join(_visible_character(character) for character in text)


def visible_lines(text: str) -> str:
    """Line feeds and tabs stay. A carriage return before a line feed is left out."""
    parts = text.replace("\r\n", "\n").split("\n")
    return "\n".join("\t".join(visible(part) for part in line.split("\t")) for line in parts)


def visible_values(value: Any) -> Any:
    """Of JSON or YAML: all texts in it, also the names."""
    if isinstance(value, str):
        return visible(value)
    if isinstance(value, list):
        return [visible_values(each) for each in value]
    if isinstance(value, dict):
        return {visible_values(name): visible_values(each) for name, each in value.items()}
    return value


def _visible_character(character: str) -> str:
    return character if character.isprintable() else character.encode("unicode_escape", "backslashreplace").decode()


def focal_words(error: float) -> str:
    """Of focal lengths, by which share they differ: "1.9 % shorter"."""
    return f"{100 * abs(error):.1f} % {'longer' if error > 0 else 'shorter'}"
