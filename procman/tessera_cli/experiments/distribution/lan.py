"""A LAN made of network namespaces: hosts that share nothing but packets, on one switch. Needs root.

The hosts and the switch, a bridge that snoops IGMP, are namespaces of their own, so that nothing of it is seen on the
machine's own network, and no multicast leaves it. A file under LOCKS is locked as long as the process lives that made a
LAN; what one left behind that was killed is removed when the next one is made.
"""

import fcntl
import json
import os
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from tessera_cli.errors import RunError, UserError

LOCKS = Path("/run/tessera")
SPACES = Path("/run/netns")
PREFIX = "tessera"
DEVICE = "eth0"
# Of a shaped link: what a port may send at once, and what it queues: a good switch. A cheap one has a tenth of it.
BURST_BYTES = 64_000
QUEUE_BYTES = 4_000_000
# So that the bridge knows early who listens to what; in hundredths of a second. Hosts speak version 3 of IGMP from the
# start, and a query of version 2 makes them forget to tell what they joined just before it.
SNOOPING = (
    *("mcast_snooping", 1, "mcast_querier", 1, "mcast_igmp_version", 3, "mcast_query_response_interval", 50),
    *("mcast_startup_query_interval", 100, "mcast_startup_query_count", 60),
)


@dataclass(frozen=True)
class Traffic:
    """Bytes on the link between a host and the switch, with all headers."""

    sent: int  # by the host
    received: int

    def __sub__(self, earlier: "Traffic") -> "Traffic":
        return Traffic(self.sent - earlier.sent, self.received - earlier.received)


def require_root(command: str) -> None:
    """Raises UserError with what `command` lacks here."""
    if os.geteuid() != 0:
        raise UserError(f"{command} makes network namespaces and limits CPU time, which only root may: use sudo.")
    for tool in ("ip", "tc", "nsenter"):
        if not shutil.which(tool):
            raise UserError(f"{command} needs {tool}: sudo apt-get install iproute2 util-linux.")


class Lan:
    """Hosts 1, 2, ... between entering and leaving its context."""

    def __init__(self, rates_mbit: Sequence[float | None]) -> None:
        """`rates_mbit`: of each host's link, in both directions; None: as fast as the machine."""
        self._rates = dict(enumerate(rates_mbit, start=1))
        self._name = ""

    def __enter__(self) -> Self:
        """Raises RunError if this machine makes no namespaces."""
        remove_stale()
        self._name, self._lock = _reserve()
        try:
            self._make()
        except BaseException:
            self.remove()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.remove()

    @property
    def hosts(self) -> list[int]:
        return list(self._rates)

    def at(self, host: int) -> list[str]:
        """What stands before a command that is to run there."""
        # Not `ip netns exec`, which hides the machine's control groups.
        return ["nsenter", f"--net={SPACES / self._space(host)}", "--"]

    def set_link(self, host: int, state: str) -> None:
        """`state`: up or down. As if its cable were pulled."""
        ip("-n", self._switch, "link", "set", _port(host), state)

    def lose(self, percent: int) -> None:
        """From now on, each host loses so much of what it receives, at random. 0: nothing. Needs nft."""
        devices = ["lo"] if len(self._rates) == 1 else ["lo", DEVICE]
        for host in self._rates:
            run_tool(*self.at(host), "nft", loss_rules(percent, devices))

    def traffic(self, host: int) -> Traffic:
        """Since the LAN was made. On a LAN of one host, which has no link: what its processes sent to each other."""
        is_alone = len(self._rates) == 1
        space, device = (self._space(host), "lo") if is_alone else (self._switch, _port(host))
        counted = json.loads(ip("-j", "-s", "-n", space, "link", "show", "dev", device))[0]["stats64"]
        # The port of the switch sees what its host sends as received.
        return Traffic(sent=counted["rx"]["bytes"], received=counted["tx"]["bytes"])

    def remove(self) -> None:
        _remove(self._name)
        os.close(self._lock)

    @property
    def _switch(self) -> str:
        return f"{self._name}-switch"

    def _space(self, host: int) -> str:
        return f"{self._name}-host{host}"

    def _make(self) -> None:
        for host in self._rates:
            ip("netns", "add", self._space(host))
            ip("-n", self._space(host), "link", "set", "lo", "multicast", "on", "up")
        if len(self._rates) == 1:
            ip("-n", self._space(1), "route", "add", "224.0.0.0/4", "dev", "lo")
            return
        ip("netns", "add", self._switch)
        ip("-n", self._switch, "link", "add", "switch", "type", "bridge", *SNOOPING)
        ip("-n", self._switch, "link", "set", "switch", "up")
        for host, rate in self._rates.items():
            self._connect(host, rate)

    def _connect(self, host: int, rate_mbit: float | None) -> None:
        space, port = self._space(host), _port(host)
        ip("link", "add", port, "netns", self._switch, "type", "veth", "peer", "name", DEVICE, "netns", space)
        ip("-n", self._switch, "link", "set", port, "master", "switch", "up")
        ip("-n", space, "addr", "add", f"10.77.0.{host}/24", "dev", DEVICE)
        ip("-n", space, "link", "set", DEVICE, "up")
        ip("-n", space, "route", "add", "224.0.0.0/4", "dev", DEVICE)
        if rate_mbit is not None:
            shape = ("root", "tbf", "rate", f"{rate_mbit}mbit", "burst", BURST_BYTES, "limit", QUEUE_BYTES)
            run_tool("tc", "-n", space, "qdisc", "add", "dev", DEVICE, *shape)
            run_tool("tc", "-n", self._switch, "qdisc", "add", "dev", port, *shape)


def remove_stale() -> None:
    """Removes the namespaces of LANs whose processes have ended."""
    for path in sorted(LOCKS.glob(f"{PREFIX}*")):
        with _locked(path) as lock:
            if lock is not None:
                _remove(path.name)
                path.unlink(missing_ok=True)


def _reserve() -> tuple[str, int]:
    """A name that no other LAN has, and the descriptor of its lock."""
    LOCKS.mkdir(parents=True, exist_ok=True)
    name = f"{PREFIX}{os.getpid()}"
    while (LOCKS / name).exists():  # of another LAN of this process
        name += "a"
    lock = os.open(LOCKS / name, os.O_RDWR | os.O_CREAT)
    fcntl.flock(lock, fcntl.LOCK_EX)
    return name, lock


@contextmanager
def _locked(path: Path) -> Iterator[int | None]:
    """None: another process holds the lock."""
    lock = os.open(path, os.O_RDWR)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield lock
    except BlockingIOError:
        yield None
    finally:
        os.close(lock)


def _remove(name: str) -> None:
    for path in SPACES.glob(f"{name}-*"):
        subprocess.run(["ip", "netns", "del", path.name], capture_output=True)
    (LOCKS / name).unlink(missing_ok=True)


def _port(host: int) -> str:
    return f"port{host}"


def loss_rules(percent: int, devices: Sequence[str]) -> str:
    """What nft is to do so that so much of what arrives by the devices is lost, at random; 0: nothing any more.

    Before fragments of a datagram are put together: each packet is lost by itself, as on a cable.
    """
    table, hook = "netdev loss", f"type filter hook ingress devices = {{ {', '.join(devices)} }} priority 0"
    rule = f"; add rule {table} ingress meta l4proto udp numgen random mod 100 < {percent} drop" if percent else ""
    return f"add table {table}; add chain {table} ingress {{ {hook}; }}; flush chain {table} ingress{rule}"


def ip(*words: object) -> str:
    return run_tool("ip", *words)


def run_tool(*words: object) -> str:
    """Its output. Raises RunError with what it said."""
    finished = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    if finished.returncode != 0:
        command = " ".join(str(word) for word in words)
        raise RunError(f"this machine makes no network of namespaces: {command}: {finished.stderr.strip()}")
    return finished.stdout
