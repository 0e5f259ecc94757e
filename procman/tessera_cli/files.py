"""Writing files that nobody ever sees half-written, and the places of this checkout."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# TESSERA_BUILD: another build of the same sources, for those who work on them.
BUILD = Path(os.environ.get("TESSERA_BUILD", ROOT / "build"))
BIN = BUILD / "bin"


def unfinished(path: Path) -> Path:
    """Name under which `path` is written until it is whole; keeps the suffix, which some writers look at."""
    return path.with_name(f".unfinished-{path.name}")


def write_text(path: Path, text: str) -> None:
    unfinished(path).write_text(text)
    os.replace(unfinished(path), path)
