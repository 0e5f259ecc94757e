"""Ends what a deputy leaves when it dies, however that went.

The guard is a process of its own: python -m tessera_cli.supervision.guard MARK. It waits until its standard input is closed,
whose other end the deputy holds: the kernel closes it when the deputy dies.
"""

import os
import signal
import subprocess
import sys

from tessera_cli.errors import RunFailed
from tessera_cli.files import ROOT
from tessera_cli.supervision.process_tree import kill_marked


class Guard:
    """The deputy's side."""

    def __init__(self, mark: str) -> None:
        """`mark`: what the marks of all its processes begin with. Those of an earlier deputy are ended now."""
        if not kill_marked(mark):
            raise RunFailed("processes of an earlier deputy of this folder can't be ended.")
        self._mark = mark
        self._process = self._start()

    def _start(self) -> subprocess.Popen:
        return subprocess.Popen(
            [sys.executable, "-m", "tessera_cli.supervision.guard", self._mark],
            stdin=subprocess.PIPE,
            start_new_session=True,
            env={**os.environ, "PYTHONPATH": str(ROOT / "procman")},
        )

    def watch(self) -> None:
        """Starts another guard if somebody has ended this one."""
        if self._process.poll() is not None:
            self._process = self._start()

    def end(self) -> int:
        """Its exit status; 0: nothing is left."""
        self._process.stdin.close()
        return self._process.wait()


def main() -> int:
    # Who ends the deputy's whole group must not end the guard before its work.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    while os.read(0, 4096):
        pass
    return 0 if kill_marked(sys.argv[1]) else 1


if __name__ == "__main__":
    sys.exit(main())
