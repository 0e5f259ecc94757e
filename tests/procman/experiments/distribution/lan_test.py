"""Hosts in network namespaces: links with a rate and a counter, lost packets, and nothing left behind. Needs root."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from helpers.stack import environment, read_line, wait_for
from tessera_cli.errors import RunError, UserError
from tessera_cli.experiments.distribution.lan import LOCKS, SPACES, Lan, remove_stale, require_root

SENDER = """
import socket
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
for _ in range(200):
    out.sendto(bytes(1400), ("10.77.0.2", 5000))
"""


@pytest.fixture
def lan() -> Iterator[Lan]:
    try:
        require_root("the test")
        with Lan([1000.0, 10.0]) as made:
            yield made
    except (UserError, RunError) as error:
        pytest.skip(str(error))


def send(lan: Lan) -> None:
    """280 kB from the first host to the second."""
    subprocess.run([*lan.at(1), sys.executable, "-c", SENDER], check=True)


def test_a_link_counts_what_it_carries(lan: Lan) -> None:
    before = [lan.traffic(host) for host in lan.hosts]
    send(lan)
    wait_for(lambda: (lan.traffic(2) - before[1]).received > 280_000, "the slow link")
    assert 280_000 < (lan.traffic(1) - before[0]).sent < 320_000
    assert (lan.traffic(2) - before[1]).sent < 50_000


def test_lost_packets_are_lost_on_arrival_until_it_ends(lan: Lan) -> None:
    if not shutil.which("nft"):
        pytest.skip("lost packets need nft: apt-get install nftables")
    lan.lose(40)
    listing = subprocess.run([*lan.at(2), "nft", "list", "ruleset"], check=True, capture_output=True, text=True).stdout
    assert "numgen random mod 100 < 40 drop" in listing
    lan.lose(0)
    listing = subprocess.run([*lan.at(2), "nft", "list", "ruleset"], check=True, capture_output=True, text=True).stdout
    assert "drop" not in listing


def test_a_lan_that_was_killed_is_removed_by_the_next_one(lan: Lan) -> None:
    """And the one that is in use is not."""
    code = (
        "import time\nfrom tessera_cli.experiments.distribution.lan import Lan\n"
        "with Lan([None, None]) as lan:\n    print(lan.at(1)[1], flush=True)\n    time.sleep(60)\n"
    )
    other = subprocess.Popen([sys.executable, "-c", code], env=environment(), stdout=subprocess.PIPE, text=True)
    space = Path(read_line(other).strip().removeprefix("--net="))
    assert space.exists()
    other.send_signal(signal.SIGKILL)
    other.wait()
    assert space.exists()
    remove_stale()
    assert not space.exists() and not (LOCKS / f"tessera{other.pid}").exists()
    assert (SPACES / f"tessera{os.getpid()}-host1").exists()


def test_only_root_may() -> None:
    if os.geteuid() == 0:
        pytest.skip("this user is root")
    with pytest.raises(UserError, match="only root may"):
        require_root("experiment single")
