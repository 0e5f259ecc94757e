"""Writing files that nobody ever sees half-written, and the places of this checkout."""

import os
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# TESSERA_BUILD: another build of the same sources, for those who work on them.
BUILD = Path(os.environ.get("TESSERA_BUILD", ROOT / "build"))
BIN = BUILD / "bin"


def unfinished(path: Path) -> Path:
    """Name under which `path` is written until it is whole; keeps the suffix, which some writers look at."""
    return path.with_name(f".unfinished-{path.name}")


@contextmanager
def replacing(path: Path):
    """Gives the name to write to; it becomes `path` at the end, and nothing is left if writing fails or is interrupted."""
    written = unfinished(path)
    try:
        yield written
        os.replace(written, path)
    finally:
        written.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    with replacing(path) as written:
        written.write_text(text)
