"""The folder of a deputy: the logs of its processes and, on a node, the last order of each list and its settings."""

import fcntl
import os
import time
from pathlib import Path

from tessera_cli.errors import UserError
from tessera_cli.files import write_private, write_text
from tessera_cli.membership import RunDir

# Of the deputy's earlier lives, those that are remembered; and an epoch has 16 digits until the year 2286.
MAX_EPOCHS = 1000
MAX_EPOCH_DIGITS = 18


class LogFolder:
    """Used by one deputy at a time, whose processes carry its path in their mark (process_tree.py)."""

    def __init__(self, path: Path, sentence_if_used: str) -> None:
        """Creates the folder. Raises UserError, with this sentence if another deputy uses it."""
        self.path = path
        try:
            self.log_path("any").parent.mkdir(parents=True, exist_ok=True)
            # Never closed: the lock ends with this process. Its file, unlike a folder, can't be opened by other users.
            self._lock = os.open(path / ".lock", os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
            os.fchmod(self._lock, 0o600)
        except OSError as error:
            raise UserError(f"the folder {path} can't be used: {error.strerror}.") from error
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise UserError(sentence_if_used) from error

    def log_path(self, process: str) -> Path:
        return self.path / f"{process}.log"

    def mark(self, process: str = "") -> str:
        """Without `process`: what all marks begin with."""
        return f"{self.path}/{process}"


class StateFolder(LogFolder):
    """Of a node's deputy."""

    def __init__(self, path: Path, deputy: str) -> None:
        try:
            path.mkdir(parents=True, exist_ok=True)
            path.chmod(0o700)  # orders and logs may hold the password of a camera
        except OSError as error:
            raise UserError(f"the folder {path} can't be made this user's own: {error.strerror}.") from error
        super().__init__(
            path,
            f"a deputy with the id {deputy} and this port runs on this machine already: give --id NAME or --port N.",
        )
        (path / "orders").mkdir(exist_ok=True)

    def log_path(self, process: str) -> Path:
        return self.path / "logs" / f"{process}.log"

    def settings_path(self, run: str) -> Path:
        return self.path / f"settings-{run}.yaml"

    def keep_settings(self, runs: set[str]) -> None:
        """Removes the settings of all other runs."""
        kept = {self.settings_path(run) for run in runs}
        for path in self.path.glob("settings-*.yaml"):
            if path not in kept:
                path.unlink(missing_ok=True)

    def run_dir(self, list_name: str) -> RunDir:
        """What the members of a list share on this node."""
        return RunDir(self.path / "runs" / list_name)

    def begin_epoch(self) -> tuple[int, set[int]]:
        """The epoch of a deputy that starts, and those of its earlier lives here, which are all smaller.

        It is the time in us since 1970, unless the clock was set back.
        """
        path = self.path / "epochs"
        words = path.read_text().split() if path.exists() else []
        earlier = {int(word) for word in words if word.isdecimal() and len(word) < MAX_EPOCH_DIGITS}
        epoch_us = max(int(time.time() * 1e6), max(earlier, default=0) + 1)
        kept = sorted(earlier)[-MAX_EPOCHS:]
        write_text(path, "".join(f"{number}\n" for number in [*kept, epoch_us]))
        return epoch_us, earlier

    def keep_order(self, list_name: str, data: bytes) -> None:
        write_private(self.path / "orders" / list_name, data)

    def forget_orders(self, list_name: str) -> None:
        """Of all lists if the name is empty."""
        for path in self._orders():
            if list_name in ("", path.name):
                path.unlink()

    def last_orders(self) -> list[bytes]:
        """One for each list that was not ended."""
        return [path.read_bytes() for path in self._orders()]

    def _orders(self) -> list[Path]:
        return sorted((self.path / "orders").glob("[!.]*"))
