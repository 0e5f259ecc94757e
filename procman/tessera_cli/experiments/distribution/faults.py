"""What goes wrong in the middle of a run, on purpose: a node that ends and comes back, and lost packets."""

import os
import shutil
import signal
import time
from typing import Protocol

from tessera_cli.errors import UserError
from tessera_cli.experiments.distribution.grid import KILLED, LOSS, Configuration, Experiment
from tessera_cli.experiments.distribution.lan import Lan
from tessera_cli.experiments.distribution.nodes import Nodes

LOSS_PERCENT = 2
# Of what an undisturbed run sends to the node that ends, or loses packets: when it begins, and when the loss ends.
BEGIN, END = 1 / 3, 2 / 3
OFF_S = 3.0
LOOK_PERIOD_S = 0.3


def require_tools() -> None:
    if not shutil.which("nft"):
        raise UserError("lost packets need nft (sudo apt-get install nftables); or give --no-faults.")


class Fault(Protocol):
    """`look` is called several times a second during the run, `end` when it is over."""

    def look(self) -> None: ...

    def end(self) -> None: ...


class NoFault:
    def look(self) -> None:
        pass

    def end(self) -> None:
        pass


class _Middle:
    """How much of its bytes a host has received since the fault was made."""

    def __init__(self, lan: Lan, host: int, expected_bytes: int) -> None:
        self._lan, self._host, self._expected = lan, host, expected_bytes
        self._before = lan.traffic(host).received
        self._looked_at = 0.0
        self._share = 0.0

    def share(self) -> float:
        if time.monotonic() - self._looked_at >= LOOK_PERIOD_S:
            self._looked_at = time.monotonic()
            self._share = (self._lan.traffic(self._host).received - self._before) / self._expected
        return self._share


class KilledNode:
    """The last host loses its power and comes back; where all work is on one host, one extractor is killed."""

    def __init__(self, lan: Lan, nodes: Nodes, middle: _Middle) -> None:
        self._host, self._nodes, self._middle = lan.hosts[-1], nodes, middle
        self._is_alone = len(lan.hosts) == 1
        self._killed_at: float | None = None
        self._is_over = False

    def look(self) -> None:
        if self._killed_at is None:
            if self._middle.share() >= BEGIN:
                self._kill()
        elif not self._is_over and time.monotonic() - self._killed_at >= OFF_S:
            self.end()

    def _kill(self) -> None:
        self._killed_at = time.monotonic()
        if self._is_alone:
            for pid in self._nodes.pids_of(self._host, "extractor_0"):
                os.kill(pid, signal.SIGKILL)
        else:
            self._nodes.kill(self._host)

    def end(self) -> None:
        if self._killed_at is not None and not self._is_over and not self._is_alone:
            self._nodes.restart(self._host)
        self._is_over = self._killed_at is not None


class LostPackets:
    """Each host loses LOSS_PERCENT of what it receives."""

    def __init__(self, lan: Lan, middle: _Middle) -> None:
        self._lan, self._middle = lan, middle
        self._percent = 0

    def look(self) -> None:
        percent = LOSS_PERCENT if BEGIN <= self._middle.share() < END else 0
        if percent != self._percent:
            self._lose(percent)

    def end(self) -> None:
        if self._percent:
            self._lose(0)

    def _lose(self, percent: int) -> None:
        self._percent = percent
        self._lan.lose(percent)


def make_fault(
    configuration: Configuration, experiment: Experiment, lan: Lan, nodes: Nodes, expected_bytes: int
) -> Fault:
    """`expected_bytes`: that the last host of this configuration receives in an undisturbed run."""
    if configuration.variant not in (KILLED, LOSS):
        return NoFault()
    middle = _Middle(lan, experiment.num_hosts(configuration.extractors), max(1, expected_bytes))
    return KilledNode(lan, nodes, middle) if configuration.variant == KILLED else LostPackets(lan, middle)
