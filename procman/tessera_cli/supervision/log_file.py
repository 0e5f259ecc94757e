"""The log of one process on its node: the newest file and a few older ones, rotated by logging.handlers."""

import logging
from logging.handlers import RotatingFileHandler
from pathlib import Path

from tessera_cli.constants import LOG_FILE_BYTES, NUM_OLD_LOG_FILES

# Of each file, what is read to find its last lines.
TAIL_BYTES = 1_000_000


class ProcessLog:
    """`path` is the newest file; path.1, path.2, ... are older. Appends to what an earlier deputy wrote."""

    def __init__(self, path: Path, max_bytes: int = LOG_FILE_BYTES, num_old: int = NUM_OLD_LOG_FILES) -> None:
        self.path = path
        path.parent.mkdir(parents=True, exist_ok=True)  # the folder of its list
        # Bytes pass through unchanged: what is not UTF-8 is escaped on the way in and unescaped on the way out.
        self._handler = _LogHandler(
            path, maxBytes=max_bytes, backupCount=num_old, encoding="utf-8", errors="surrogateescape"
        )
        self._handler.terminator = ""  # the output of a process brings its own line ends

    def write(self, data: bytes) -> None:
        """Data is lost if it can't be written: a full disk must not end the process that is logged."""
        text = data.decode(errors="surrogateescape")
        self._handler.emit(logging.LogRecord("", logging.INFO, "", 0, text, None, None))

    def tail(self, num_lines: int) -> str:
        """The last lines, of the newest file and the one before."""
        data = b""
        for path in (self.path.with_name(f"{self.path.name}.1"), self.path):
            if path.exists():
                data += path.read_bytes()[-TAIL_BYTES:]
        return "".join(line + "\n" for line in data.decode(errors="replace").splitlines()[-num_lines:])

    def close(self) -> None:
        self._handler.close()


class _LogHandler(RotatingFileHandler):
    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802, logging's own name
        """Does nothing, where logging would print a traceback for each lost line."""
