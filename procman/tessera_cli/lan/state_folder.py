"""A deputy's folder: the logs of its processes; on a node also the last order it obeyed, and their settings."""

import fcntl
import os
from pathlib import Path

from tessera_cli.errors import UserError
from tessera_cli.files import replacing


class LogFolder:
    """One deputy at a time has it. Its processes carry the folder's path in their mark (tree.py), so that each can be found."""

    def __init__(self, path: Path, taken: str):
        """Makes the folder. `taken`: the sentence if another deputy has it."""
        self.path = path
        try:
            self.log_path("any").parent.mkdir(parents=True, exist_ok=True)
            self._lock = os.open(path, os.O_RDONLY)  # never closed: the lock goes with this process
        except OSError as error:
            raise UserError(f"the folder {path} can't be used: {error.strerror}.") from error
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise UserError(taken) from error

    def log_path(self, process: str) -> Path:
        return self.path / f"{process}.log"

    def mark(self, process: str = "") -> str:
        """Without `process`: what all marks begin with."""
        return f"{self.path}/{process}"


class StateFolder(LogFolder):
    """Of a node's deputy."""

    def __init__(self, path: Path, deputy: str):
        super().__init__(path, f"a deputy with the id {deputy} and this port runs on this machine already: give --id NAME or --port N.")
        self._order_path = path / "last_order"

    def log_path(self, process: str) -> Path:
        return self.path / "logs" / f"{process}.log"

    def settings_path(self, run: str) -> Path:
        return self.path / f"settings-{run}.yaml"

    def forget_other_settings(self, run: str) -> None:
        for path in self.path.glob("settings-*.yaml"):
            if path != self.settings_path(run):
                path.unlink(missing_ok=True)

    def keep_order(self, data: bytes) -> None:
        with replacing(self._order_path) as written:
            written.write_bytes(data)

    def last_order(self) -> bytes:
        return self._order_path.read_bytes() if self._order_path.exists() else b""
