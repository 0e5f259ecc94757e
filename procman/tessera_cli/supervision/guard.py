"""Ends what a deputy leaves behind when it dies, for whatever reason.

The guard is a process of its own: python -P -m tessera_cli.supervision.guard MARK. It waits until its standard input is
closed, whose other end the deputy holds: the kernel closes it when the deputy dies.
"""

import os
import signal
import subprocess
import sys

from tessera_cli.errors import RunError
from tessera_cli.files import PROCMAN, python_command
from tessera_cli.supervision.process_tree import kill_marked


class Guard:
    """The deputy's side of its guard process."""

    def __init__(self, mark: str) -> None:
        """`mark`: the beginning of the marks of all its processes. Those of an earlier deputy are killed now."""
        if not kill_marked(mark):
            raise RunError("processes of an earlier deputy of this folder can't be ended.")
        self._mark = mark
        self._process = self._start()

    def _start(self) -> "subprocess.Popen[bytes]":
        return subprocess.Popen(
            [*python_command("tessera_cli.supervision.guard"), self._mark],
            stdin=subprocess.PIPE,
            start_new_session=True,
            env={**os.environ, "PYTHONPATH": str(PROCMAN)},
        )

    def watch(self) -> None:
        """Starts another guard if this one was ended."""
        if self._process.poll() is not None:
            self._process = self._start()

    def end(self) -> int:
        """Its exit status; 0: no process is left."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        return self._process.wait()


def main() -> int:
    # A signal to the deputy's whole group must not end the guard before its work is done.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    while os.read(0, 4096):
        pass
    return 0 if kill_marked(sys.argv[1]) else 1


if __name__ == "__main__":
    sys.exit(main())
