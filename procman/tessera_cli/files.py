"""The folders of this checkout, its Python, and files that are written whole or not at all."""

import errno
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROCMAN = ROOT / "procman"
# TESSERA_BUILD: another build of the same sources, for developers.
BUILD = Path(os.environ.get("TESSERA_BUILD", ROOT / "build"))
BIN = BUILD / "bin"
# What writing fails with where the disk is full, over its quota, or broken.
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


def python_command(module: str) -> list[str]:
    """Runs a module in another process, with `PYTHONPATH`: the folder that holds tessera_cli.

    -P: modules are not looked for in the working folder, which may be anybody's. UTF-8 whatever the locale.
    """
    return [sys.executable, "-P", "-X", "utf8", "-m", module]


def unfinished(path: Path) -> Path:
    """The name under which `path` is written until it is complete; it keeps the suffix, which some writers look at."""
    return path.with_name(f".unfinished-{path.name}")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yields the name to write to, which becomes `path` at the end. Nothing is left if writing fails."""
    written = unfinished(path)
    try:
        yield written
        os.replace(written, path)
    except OSError as error:
        # Writing does not tell which file it was; opening does.
        if error.filename is None and error.errno in NO_ROOM:
            error.filename = str(path)
        raise
    finally:
        written.unlink(missing_ok=True)


@contextmanager
def replacing_folder(path: Path) -> Iterator[Path]:
    """Yields a new folder to write into, which becomes `path` at the end. Nothing is left if writing fails."""
    written = unfinished(path)
    shutil.rmtree(written, ignore_errors=True)
    written.mkdir()
    try:
        yield written
        if path.exists():
            shutil.rmtree(path)
        os.replace(written, path)
    finally:
        shutil.rmtree(written, ignore_errors=True)


def write_text(path: Path, text: str) -> None:
    """Writes `path` whole or not at all."""
    with replacing(path) as written:
        written.write_text(text)


def write_private(path: Path, data: bytes) -> None:
    """Writes `path` whole or not at all. Nobody else can read or change it."""
    with replacing(path) as written:
        written.unlink(missing_ok=True)
        with os.fdopen(os.open(written, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(data)


def changed_by_others(path: Path) -> bool:
    """Whether other users (except root) can change this file or folder."""
    status = path.stat()
    return status.st_uid not in (os.geteuid(), 0) or bool(status.st_mode & 0o022)


def absolute(text: str) -> Path:
    """A path as typed by a user, absolute and with ~ replaced."""
    return Path(text).expanduser().absolute()
