"""The real command, started as a user starts it, with each run on ports and in a folder of its own."""

import json
import os
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lcm

from tessera_cli.files import python_command

ROOT = Path(__file__).resolve().parents[2]
# A run of a few frames takes seconds; a hang must not stop the whole suite.
RUN_TIMEOUT_S = 120.0
NUM_FRAMES = 60
PORTS_PER_RUN = 40


def _suite() -> int:
    """Another number for each test suite on this machine, and for each of its three workers (pytest-xdist)."""
    worker = os.environ.get("PYTEST_XDIST_WORKER")
    return 3 * os.getppid() + int(worker.removeprefix("gw")) if worker else 3 * os.getpid()


# Two test suites on one machine use different ports, above those that a run takes by itself and below 32768: from
# there on Linux gives them to sockets that send without having asked for a port, which may be anybody's.
SUITE = _suite()
FIRST_PORT = 14000 + (SUITE % 23) * 800


def environment() -> dict[str, str]:
    """In which the command is started."""
    return {**os.environ, "PYTHONPATH": str(ROOT / "procman")}


def wait_for(condition: Callable[[], object], what: str, timeout_s: float = RUN_TIMEOUT_S) -> None:
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        time.sleep(0.02)


def wait_for_a_pose(port: int) -> None:
    """Of the stack on this port: its camera and all others are at work."""
    poses: list[bytes] = []
    bus = lcm.LCM(f"udpm://239.255.76.67:{port}?ttl=0")
    bus.subscribe("POSE", lambda _channel, data: poses.append(data))
    wait_for(lambda: (bus.handle_timeout(20), poses)[1], "a pose")


def read_line(process: "subprocess.Popen[str]") -> str:
    """The next line of its output; empty at its end."""
    assert process.stdout is not None
    return process.stdout.readline()


def must_succeed(process: "subprocess.Popen[str]") -> None:
    """Waits for its end."""
    out, _ = process.communicate(timeout=RUN_TIMEOUT_S)
    assert process.returncode == 0, out


def pids_of(folder: Path, stage: str = "") -> list[int]:
    """Processes whose settings are those of the run in `folder`."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if str(folder / "settings.yaml").encode() in words and Path(words[0].decode()).name.startswith(
            f"tessera-{stage}"
        ):
            found.append(int(entry.name))
    return found


@dataclass
class Finished:
    """A command that has ended."""

    status: int
    out: str
    err: str
    folder: Path

    @property
    def summary(self) -> dict[str, Any]:
        return json.loads((self.folder / "summary.json").read_text())

    def must_end_well(self) -> "Finished":
        assert self.status == 0, self.out + self.err
        return self

    def must_refuse(self, *words: str) -> None:
        """One sentence with these words, and exit status 2."""
        assert self.status == 2, self.out + self.err
        assert self.err.count("\n") == 1, self.err
        assert self.err.startswith("tessera: ")
        for word in words:
            assert word in self.err


class Tessera:
    """`command` starts any subcommand, `run` one with a folder and ports of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._num_runs = 0

    def command(self, *arguments: object, timeout: float = RUN_TIMEOUT_S) -> Finished:
        finished = subprocess.run(
            self._command_line(arguments),
            capture_output=True,
            text=True,
            timeout=timeout,
            env=environment(),
            stdin=subprocess.DEVNULL,
        )
        return Finished(finished.returncode, finished.stdout, finished.stderr, self._folder)

    def run(self, *arguments: object, command: str = "run") -> Finished:
        port, folder = self.next_port(), self.next_folder()
        finished = self.command(command, *arguments, "--port", port, "--out", folder)
        finished.folder = folder
        return finished

    def start(self, *arguments: object, **variables: str) -> "subprocess.Popen[str]":
        """In the background; ends when the test ends it. `variables`: of the environment."""
        return subprocess.Popen(
            self._command_line(arguments),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**environment(), **variables},
            stdin=subprocess.DEVNULL,
        )

    def next_port(self) -> int:
        self._num_runs += 1
        return FIRST_PORT + PORTS_PER_RUN * (self._num_runs % 20)

    def next_folder(self) -> Path:
        return self._folder / f"run {self._num_runs}"

    def _command_line(self, arguments: tuple[object, ...]) -> list[str]:
        return [*python_command("tessera_cli"), *map(str, arguments)]
