"""Nodes: deputies as a user starts them, and whoever gives them orders."""

import json
import subprocess
from pathlib import Path
from typing import Any, Protocol

from helpers.stack import ROOT, RUN_TIMEOUT_S, SUITE, environment, read_line
from tessera_cli.files import python_command

PORTS_PER_NODE = 25
# Two test suites on one machine use different ports.
FIRST_NODE_PORT = 61000 + (SUITE % 7) * 20 * PORTS_PER_NODE


class Node:
    """A deputy with an id, a port and a folder, and commands given on the same node. `prefix`: words before each."""

    def __init__(
        self,
        folder: Path,
        port: int,
        commands: str = "",
        deputy: str = "node1",
        prefix: tuple[str, ...] = (),
        is_lan: bool = False,
    ) -> None:
        self.folder, self.port, self.deputy = folder, port, deputy
        self._prefix, self._lan = prefix, ["--lan"] if is_lan else []
        self.commands_path = ROOT / "procman" / "commands.pmd"
        if commands:
            self.commands_path = folder / "commands.pmd"
            self.commands_path.write_text(commands)
        self._process: subprocess.Popen[str] | None = None

    @property
    def process(self) -> "subprocess.Popen[str]":
        """The deputy."""
        assert self._process is not None
        return self._process

    def line(self, *words: object) -> list[str]:
        return [
            *(*self._prefix, *python_command("tessera_cli")),
            *map(str, words),
            *("--port", str(self.port)),
            *self._lan,
        ]

    def start(self) -> "Node":
        options = ("--id", self.deputy, "--folder", self.folder / "state", "--commands", self.commands_path)
        self._process = self.start_command("deputy", *options)
        read_line(self._process)  # it says that it is there
        return self

    def end(self) -> int:
        self.process.terminate()
        return self.process.wait(RUN_TIMEOUT_S)

    def end_if_running(self) -> None:
        if self._process and self._process.poll() is None:
            self.end()

    def kill(self) -> None:
        self.process.kill()
        self.process.wait(RUN_TIMEOUT_S)

    def marked(self) -> list[int]:
        """All processes that the deputy or an earlier one of its folder has started."""
        from tessera_cli.supervision.process_tree import marked

        return marked(f"{self.folder / 'state'}/")

    def command(self, *arguments: object) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(
            self.line(*arguments),
            env=environment(),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=RUN_TIMEOUT_S,
        )

    def start_command(self, *arguments: object) -> "subprocess.Popen[str]":
        """In the background; ends when the test ends it."""
        return subprocess.Popen(
            self.line(*arguments),
            env=environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def up(self, text: str, *options: object, name: str = "list") -> "subprocess.CompletedProcess[str]":
        path = self.folder / f"{name}.pmd"
        path.write_text(text)
        return self.command("up", path, *options)

    def status(self) -> dict[str, Any]:
        return json.loads(self.command("status", "--json").stdout)[self.deputy]

    def processes(self, name: str = "list") -> dict[str, Any]:
        """Of this list; `up` makes one that is named so."""
        return self.status()["lists"].get(name, {}).get("processes", {})


class MakeNode(Protocol):
    """The fixture make_node."""

    def __call__(
        self,
        commands: str = "",
        deputy: str = "node1",
        port: int | None = None,
        prefix: tuple[str, ...] = (),
        is_lan: bool = False,
    ) -> Node: ...
