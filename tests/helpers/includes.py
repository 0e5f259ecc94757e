"""What the sources of modules/ include."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MODULES = ROOT / "modules"
INCLUDE = re.compile(r'^\s*#\s*include\s*(["<])([^">]+)[">]', re.MULTILINE)


def includes(path: Path) -> list[tuple[str, str]]:
    """(quote or bracket, header) of every include."""
    return INCLUDE.findall(path.read_text())


def own_includes(path: Path) -> set[str]:
    """The headers of this project: those in quotes."""
    return {header for quote, header in includes(path) if quote == '"'}
