"""What a process says, kept on its node: one file and a few older ones."""

import os
from pathlib import Path

MAX_BYTES = 10_000_000
NUM_OLD = 3


class RotatingLog:
    """`path` is the newest; path.1, path.2, ... are older. Appends to what an earlier deputy wrote."""

    def __init__(self, path: Path, max_bytes: int = MAX_BYTES, num_old: int = NUM_OLD) -> None:
        self.path = path
        self._max_bytes, self._num_old = max_bytes, num_old
        path.parent.mkdir(parents=True, exist_ok=True)  # that of its list
        self._file = open(path, "ab")

    def write(self, data: bytes) -> None:
        """A full disk must not end what is being logged: then the data is lost."""
        try:
            self._file.write(data)
            self._file.flush()
            if self._file.tell() > self._max_bytes:
                self._rotate()
        except OSError:
            pass

    def _rotate(self) -> None:
        self._file.close()
        for age in range(self._num_old, 0, -1):
            newer = self._old(age - 1)
            if newer.exists():
                os.replace(newer, self._old(age))
        self._file = open(self.path, "ab")

    def _old(self, age: int) -> Path:
        return self.path.with_name(f"{self.path.name}.{age}") if age else self.path

    def tail(self, num_lines: int) -> str:
        """The last whole lines, of the newest file and the one before."""
        text = b""
        for path in (self._old(1), self.path):
            if path.exists():
                text += path.read_bytes()[-1_000_000:]
        return "".join(line + "\n" for line in text.decode(errors="replace").splitlines()[-num_lines:])

    def close(self) -> None:
        self._file.close()
