"""A deputy's folder: its lock, the last order it obeyed, the settings of its processes, and their logs."""

import fcntl
from pathlib import Path

from tessera_cli.errors import UserError
from tessera_cli.files import replacing


class StateFolder:
    def __init__(self, path: Path, deputy: str):
        self.path = path
        try:
            (path / "logs").mkdir(parents=True, exist_ok=True)
            self._lock = open(path / "lock", "w")
        except OSError as error:
            raise UserError(f"the deputy's folder {path} can't be used: {error.strerror}.") from error
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise UserError(f"a deputy with the id {deputy} and this port runs on this machine already: give --id NAME or --port N.") from error
        self._order_path = path / "last_order"

    def log_path(self, process: str) -> Path:
        return self.path / "logs" / f"{process}.log"

    def mark(self, process: str) -> str:
        return f"{self.path}/{process}"

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
