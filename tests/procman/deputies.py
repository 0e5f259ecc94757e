"""Deputies as a user starts them, with keys of their own. Makes the command's Python package importable."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "procman"))


@pytest.fixture(autouse=True)
def own_keys(tmp_path, monkeypatch) -> Path:
    folder = tmp_path / "keys"
    monkeypatch.setenv("TESSERA_KEYS", str(folder))
    return folder


# Nothing here takes long; a hang must not take the whole suite along.
TIMEOUT_S = 120
# Beside each other on one machine, two test suites take different ports.
PORTS_PER_NODE = 25
FIRST_PORT = 61000 + (os.getpid() % 7) * 20 * PORTS_PER_NODE


class Node:
    """A deputy with an id, a port and a folder, and whoever orders it from the same node. `prefix`: words before each command."""

    def __init__(
        self,
        folder: Path,
        port: int,
        commands: str = "",
        deputy: str = "node1",
        prefix: tuple = (),
        is_lan: bool = False,
    ) -> None:
        self.folder, self.port, self.deputy = folder, port, deputy
        self._prefix, self._lan = prefix, ["--lan"] if is_lan else []
        self.commands_path = ROOT / "procman" / "commands.pmd"
        if commands:
            self.commands_path = folder / "commands.pmd"
            self.commands_path.write_text(commands)
        self.process: subprocess.Popen | None = None

    def line(self, *words) -> list[str]:
        return [
            *self._prefix,
            sys.executable,
            "-m",
            "tessera_cli",
            *map(str, words),
            "--port",
            str(self.port),
            *self._lan,
        ]

    def start(self) -> "Node":
        self.process = subprocess.Popen(
            self.line(
                "deputy", "--id", self.deputy, "--folder", self.folder / "state", "--commands", self.commands_path
            ),
            env=environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.process.stdout.readline()  # it says that it is there
        return self

    def end(self) -> int:
        self.process.terminate()
        return self.process.wait(TIMEOUT_S)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait(TIMEOUT_S)

    def marked(self) -> list[int]:
        from tessera_cli.supervision.process_tree import marked

        return marked(f"{self.folder / 'state'}/")

    def command(self, *arguments) -> subprocess.CompletedProcess:
        return subprocess.run(
            self.line(*arguments),
            env=environment(),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
        )

    def up(self, text: str, *options, name: str = "list") -> subprocess.CompletedProcess:
        path = self.folder / f"{name}.pmd"
        path.write_text(text)
        return self.command("up", path, *options)

    def status(self) -> dict:
        return json.loads(self.command("status", "--json").stdout)[self.deputy]

    def processes(self, name: str = "list") -> dict:
        """Of this list; `up` makes one that is named so."""
        return self.status()["lists"].get(name, {}).get("processes", {})


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT / "procman")}


def wait_for(condition, what: str) -> None:
    deadline = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        time.sleep(0.02)


next_node = [0]


@pytest.fixture
def make_node(tmp_path, own_keys):
    """Makes nodes whose deputies end with the test."""
    nodes = []

    def make(commands: str = "", **options) -> Node:
        next_node[0] += 1
        folder = tmp_path / f"node {len(nodes)}"
        folder.mkdir()
        nodes.append(
            Node(folder, options.pop("port", FIRST_PORT + PORTS_PER_NODE * (next_node[0] % 20)), commands, **options)
        )
        return nodes[-1]

    yield make
    for node in nodes:
        if node.process and node.process.poll() is None:
            node.end()
