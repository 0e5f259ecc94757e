"""Shares of a core: control groups of the kernel (cgroup v1 or v2), one for each slow node. Needs root.

A process that has joined a group gets, with all its threads and descendants, `share` of a core: quota / period, and
then waits for the next period. Groups have the name of the experiment's process; those of one that was killed are
removed by the next experiment.
"""

import math
import os
import time
from pathlib import Path
from typing import Self

from tessera_cli.errors import RunError, UserError

PREFIX = "tessera"
# Short, so that a step of some 100 ms takes many of them; but the kernel wants quotas of 1 ms and more.
PERIOD_US = 20_000
MIN_QUOTA_US = 1000
REMOVE_TIMEOUT_S = 5.0


def find_hierarchy(mounts: str) -> tuple[Path, int]:
    """Where the kernel's cpu controller is, and its version. `mounts`: content of /proc/mounts.

    Raises UserError if there is none.
    """
    rows = [line.split() for line in mounts.splitlines()]
    for row in rows:
        if row[2] == "cgroup" and "cpu" in row[3].split(","):
            return Path(row[1]), 1
    for row in rows:
        controllers = Path(row[1]) / "cgroup.controllers"
        if row[2] == "cgroup2" and controllers.is_file() and "cpu" in controllers.read_text().split():
            return Path(row[1]), 2
    raise UserError("this machine has no control groups for CPU time (cgroup v1 or v2 with the cpu controller).")


class CpuGroups:
    """So many groups of equal shares, between entering and leaving its context."""

    def __init__(self, count: int, hierarchy: tuple[Path, int] | None = None) -> None:
        """`hierarchy`: by default the machine's."""
        self._count = count
        self._root, self._version = hierarchy or find_hierarchy(Path("/proc/mounts").read_text())
        self.folder = self._root / f"{PREFIX}{os.getpid()}"

    def __enter__(self) -> Self:
        for path in self._root.glob(f"{PREFIX}[0-9]*"):
            if not Path(f"/proc/{path.name.removeprefix(PREFIX)}").exists():
                _remove(path)
        try:
            self.folder.mkdir(exist_ok=True)
            if self._version == 2:
                for path in (self._root, self.folder):
                    (path / "cgroup.subtree_control").write_text("+cpu")
            for number in range(self._count):
                self.group(number).mkdir(exist_ok=True)
        except OSError as error:
            raise RunError(f"control groups can't be made in {self._root}: {error.strerror}.") from error
        return self

    def __exit__(self, *_: object) -> None:
        _remove(self.folder)

    def group(self, number: int) -> Path:
        return self.folder / f"node{number}"

    def set_share(self, share: float) -> None:
        """Of a core, for each group; 1 or more: no limit."""
        quota_us, period_us = quota_and_period_us(share)
        for number in range(self._count):
            if self._version == 2:
                limit = str(quota_us) if quota_us > 0 else "max"
                (self.group(number) / "cpu.max").write_text(f"{limit} {period_us}")
            else:
                (self.group(number) / "cpu.cfs_period_us").write_text(str(period_us))
                (self.group(number) / "cpu.cfs_quota_us").write_text(str(quota_us))

    def join(self, number: int, pid: int) -> None:
        """A process that runs already; one that has just ended joins nothing."""
        try:
            (self.group(number) / "cgroup.procs").write_text(str(pid))
        except ProcessLookupError:
            pass

    def words(self, group_of: str) -> list[str]:
        """What stands before a command that is to join a group. `group_of`: its number, or what stands for it."""
        return ["sh", "-c", 'echo $$ >"$0" && exec "$@"', f"{self.folder}/node{group_of}/cgroup.procs"]


def quota_and_period_us(share: float) -> tuple[int, int]:
    """As the kernel takes them; quota -1: no limit."""
    if share >= 1.0:
        return -1, PERIOD_US
    period_us = max(PERIOD_US, math.ceil(MIN_QUOTA_US / share))
    return max(MIN_QUOTA_US, round(share * period_us)), period_us


def _remove(folder: Path) -> None:
    """The processes in it are those of deputies that have ended, or are about to."""
    deadline = time.monotonic() + REMOVE_TIMEOUT_S
    for path in [*sorted(folder.glob("node*")), folder]:
        while path.exists():
            try:
                path.rmdir()
            except OSError:
                if time.monotonic() > deadline:
                    return  # the next experiment tries again
                time.sleep(0.05)
