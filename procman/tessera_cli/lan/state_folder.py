"""A deputy's folder: its lock, the last order of each list that it obeyed, the settings of its processes, and their logs."""

import fcntl
from pathlib import Path

from tessera_cli.errors import UserError
from tessera_cli.files import replacing


class StateFolder:
    def __init__(self, path: Path, deputy: str):
        self.path = path
        try:
            (path / "logs").mkdir(parents=True, exist_ok=True)
            (path / "orders").mkdir(exist_ok=True)
            self._lock = open(path / "lock", "w")
        except OSError as error:
            raise UserError(f"the deputy's folder {path} can't be used: {error.strerror}.") from error
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise UserError(f"a deputy with the id {deputy} and this port runs on this machine already: give --id NAME or --port N.") from error

    def log_path(self, process: str) -> Path:
        path = self.path / "logs" / f"{process}.log"
        path.parent.mkdir(exist_ok=True)  # that of its list
        return path

    def mark(self, process: str) -> str:
        return f"{self.path}/{process}"

    def settings_path(self, run: str) -> Path:
        return self.path / f"settings-{run}.yaml"

    def keep_settings(self, runs: set[str]) -> None:
        """Of these runs; those of others are removed."""
        kept = {self.settings_path(run) for run in runs}
        for path in self.path.glob("settings-*.yaml"):
            if path not in kept:
                path.unlink(missing_ok=True)

    def keep_order(self, list_name: str, data: bytes) -> None:
        with replacing(self.path / "orders" / list_name) as written:
            written.write_bytes(data)

    def forget_orders(self, list_name: str) -> None:
        """Of all lists if it is empty."""
        for path in self._orders():
            if list_name in ("", path.name):
                path.unlink()

    def last_orders(self) -> list[bytes]:
        """One of each list that was not ended."""
        return [path.read_bytes() for path in self._orders()]

    def _orders(self) -> list[Path]:
        return sorted((self.path / "orders").glob("[!.]*"))
