"""Deputies on the hosts of a LAN, as a user would start them on boards and PCs: node1, node2, ...; and their stack."""

import os
import re
import subprocess
import time
from pathlib import Path
from typing import Self

import psutil

from tessera_cli.cluster.keys import KeyRing
from tessera_cli.errors import RunError
from tessera_cli.experiments.checkouts import Checkout
from tessera_cli.experiments.distribution.cpu_groups import CpuGroups
from tessera_cli.experiments.distribution.grid import Experiment
from tessera_cli.experiments.distribution.lan import Lan
from tessera_cli.files import PROCMAN, write_text
from tessera_cli.supervision.command_list import SHIPPED_LIST
from tessera_cli.supervision.guard import Guard
from tessera_cli.supervision.process_tree import MARK, marked

# The stack of a LAN as it is shipped; only the hosts of its extractors differ.
LIST = PROCMAN / "lan.pmd"
LIST_NAME = "stack"
EXTRACTORS = re.compile(r'cmd "extractor"\s*\{ host = "[^"]*"; count = \d+;')
EXTRACTOR_COMMAND = re.compile(r'cmd "extractor"\s*\{ exec = "')
START_TIMEOUT_S = 30.0
STOP_TIMEOUT_S = 20.0


def stack_list(shipped: str, experiment: Experiment, extractors: int) -> str:
    """The process list with so many extractors. `shipped`: the content of LIST."""
    hosts = [f"node{number}" for number in range(2, experiment.num_hosts(extractors) + 1)] or ["node1"]
    words = f'cmd "extractor"   {{ host = "{", ".join(hosts)}"; count = {extractors // len(hosts)};'
    text, count = EXTRACTORS.subn(words, shipped)
    if count != 1:
        raise RunError(f"{LIST} has no extractors on hosts of their own.")
    return text


def slow_commands(shipped: str, groups: CpuGroups) -> str:
    """A deputy's command list, in which each extractor joins its group first. `shipped`: that of the checkout."""
    words = " ".join(_quoted(word) for word in groups.words("${id}"))
    escaped = words.replace("\\", "\\\\").replace('"', '\\"')
    text, count = EXTRACTOR_COMMAND.subn(lambda match: match[0] + escaped + " ", shipped)
    if count != 1:
        raise RunError(f"{SHIPPED_LIST} has no extractor.")
    return text


def _quoted(word: str) -> str:
    """Not by shlex.quote, which would quote ${id} needlessly."""
    return f"'{word}'" if re.search(r'[\s"]', word) else word


class Nodes:
    """Between entering and leaving its context. Whatever an earlier one left running with this folder is ended."""

    def __init__(self, folder: Path, lan: Lan, checkout: Checkout, port: int, groups: CpuGroups | None) -> None:
        """`groups`: that extractors join, by their number."""
        self._folder, self._lan, self._checkout, self._port, self._groups = folder, lan, checkout, port, groups
        self._processes: dict[int, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Self:
        self._folder.mkdir(parents=True, exist_ok=True)
        self._guard = Guard(f"{self._folder}/")
        try:
            KeyRing(self._folder / "keys").trusted()  # made once, before several deputies look for it
            if self._groups:
                write_text(self._commands_path, slow_commands(SHIPPED_LIST.read_text(), self._groups))
            for host in self._lan.hosts:
                self._start(host, "--fresh")
            self._wait_for_all()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes.values():
            process.terminate()
        deadline = time.monotonic() + STOP_TIMEOUT_S
        for process in self._processes.values():
            try:
                process.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
        self._guard.end()

    @property
    def network_options(self) -> list[str]:
        """Of every command that speaks with the deputies."""
        return ["--port", str(self._port), *(["--lan"] if len(self._lan.hosts) > 1 else [])]

    @property
    def environment(self) -> dict[str, str]:
        """With keys of their own: the user's are neither used nor changed."""
        return {**self._checkout.environment, "TESSERA_KEYS": str(self._folder / "keys")}

    def words(self, *command: object) -> list[str]:
        """A `tessera` command on the first host."""
        return [*self._lan.at(1), *self._checkout.words, *map(str, command), *self.network_options]

    def kill(self, host: int) -> None:
        """As if its power were cut: its link is down, and all of its processes end."""
        self._lan.set_link(host, "down")
        self._processes[host].kill()
        self._processes[host].wait()

    def restart(self, host: int) -> None:
        """It resumes its last orders."""
        self._lan.set_link(host, "up")
        self._start(host)

    def pids_of(self, host: int, process: str) -> list[int]:
        """Of a process of the stack, with its descendants."""
        return marked(f"{self._folder}/node{host}/{LIST_NAME}/{process}")

    def cpu_s(self) -> float:
        """That the deputies themselves have used."""
        return sum(sum(psutil.Process(each.pid).cpu_times()[:2]) for each in self._processes.values())

    @property
    def _commands_path(self) -> Path:
        return self._folder / "commands.pmd"

    def _start(self, host: int, *options: str) -> None:
        words = [*self._lan.at(host), *self._checkout.words, "deputy", "--id", f"node{host}", *options]
        words += ["--folder", str(self._folder / f"node{host}"), *self.network_options]
        if self._groups:
            words += ["--commands", str(self._commands_path)]
        environment = {**os.environ, **self.environment, MARK: f"{self._folder}/node{host}"}
        with open(self._log(host), "wb") as log:
            self._processes[host] = subprocess.Popen(
                words, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True
            )

    def _log(self, host: int) -> Path:
        return self._folder / f"node{host}.log"

    def _wait_for_all(self) -> None:
        """Raises RunError if a deputy did not start."""
        deadline = time.monotonic() + START_TIMEOUT_S
        waiting = list(self._processes)
        while waiting:
            host = waiting[0]
            if "logs in" in self._log(host).read_text():
                waiting.pop(0)
            elif self._processes[host].poll() is not None or time.monotonic() > deadline:
                raise RunError(f"the deputy of node{host} did not start; its log: {self._log(host)}")
            else:
                time.sleep(0.05)
