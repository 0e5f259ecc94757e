"""The real processes, started as a user starts them, each test on ports of its own."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from synthetic_sequence import write_sequence

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "procman"))

NUM_FRAMES = 60
# A run of these few frames takes seconds; a hang must not take the whole suite along.
RUN_TIMEOUT_S = 120
PORTS_PER_RUN = 40
# Beside each other on one machine, two test suites take different ports.
FIRST_PORT = 20000 + (os.getpid() % 50) * 800


@dataclass
class Finished:
    status: int
    out: str
    err: str
    folder: Path | None

    @property
    def summary(self) -> dict:
        return json.loads((self.folder / "summary.json").read_text())

    def must_end_well(self) -> "Finished":
        assert self.status == 0, self.out + self.err
        return self


class Tessera:
    """`command` starts any subcommand, `run` one with a folder and ports of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._num_runs = 0

    def command(self, *arguments, timeout: float = RUN_TIMEOUT_S) -> Finished:
        finished = subprocess.run(
            self._command_line(arguments),
            capture_output=True,
            text=True,
            timeout=timeout,
            env=self._environment(),
            stdin=subprocess.DEVNULL,
        )
        return Finished(finished.returncode, finished.stdout, finished.stderr, None)

    def run(self, *arguments, command: str = "run") -> Finished:
        port, folder = self.next_port(), self.next_folder()
        finished = self.command(command, *arguments, "--port", port, "--out", folder)
        finished.folder = folder
        return finished

    def start(self, *arguments) -> subprocess.Popen:
        """In the background; ends when the test ends it."""
        return subprocess.Popen(
            self._command_line(arguments),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=self._environment(),
            stdin=subprocess.DEVNULL,
        )

    def next_port(self) -> int:
        self._num_runs += 1
        return FIRST_PORT + PORTS_PER_RUN * (self._num_runs % 20)

    def next_folder(self) -> Path:
        return self._folder / f"run {self._num_runs}"

    def _command_line(self, arguments) -> list[str]:
        return [sys.executable, "-m", "tessera_cli", *map(str, arguments)]

    def _environment(self) -> dict[str, str]:
        return {**os.environ, "PYTHONPATH": str(ROOT / "procman")}


@pytest.fixture(scope="session")
def tessera(tmp_path_factory) -> Tessera:
    return Tessera(tmp_path_factory.mktemp("runs"))


@pytest.fixture(scope="session")
def sequence(tmp_path_factory) -> Path:
    """A KITTI folder; its path has a space on purpose."""
    return write_sequence(tmp_path_factory.mktemp("made") / "room 1", NUM_FRAMES)


@pytest.fixture(scope="session")
def reference_run(tessera, sequence) -> Finished:
    """One extractor, whole images: what every other way of running must equal bit for bit."""
    return tessera.run(f"kitti:{sequence}", "--extractors", 1, "--tiles", "1x1").must_end_well()
