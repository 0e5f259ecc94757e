"""Which ports a run takes."""

import subprocess
import sys
from pathlib import Path

import pytest

from tessera_cli.constants import DEFAULT_PORT, FIRST_TILE_PORT_OFFSET, MAX_INSTANCES
from tessera_cli.lcm_bus import bus_url
from tessera_cli.membership import run_dir_of
from tessera_cli.runs import ports
from tessera_cli.runs.ports import STEP, PortLock

PREFIX = "ports_test_"


def test_a_port_is_held_by_one_run() -> None:
    lock = PortLock(DEFAULT_PORT, PREFIX)
    with pytest.raises(OSError):
        PortLock(DEFAULT_PORT, PREFIX)
    other = PortLock(DEFAULT_PORT, f"{PREFIX}b_")  # another robot on the same bus
    del lock, other
    PortLock(DEFAULT_PORT, PREFIX)


def test_a_run_that_was_killed_holds_no_port() -> None:
    program = f"""
import sys, time
from tessera_cli.runs.ports import PortLock
lock = PortLock({DEFAULT_PORT}, "{PREFIX}")
print("held", flush=True)
time.sleep(60)
"""
    holder = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None and holder.stdout.readline() == "held\n"
    with pytest.raises(OSError):
        PortLock(DEFAULT_PORT, PREFIX)
    holder.kill()
    holder.wait()
    PortLock(DEFAULT_PORT, PREFIX)


def test_the_next_free_port_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first is held by a run that has only begun, the second by a stack that sends heartbeats."""
    monkeypatch.setattr(ports, "_is_silent", lambda port, _prefix: port != DEFAULT_PORT + STEP)
    lock = PortLock(DEFAULT_PORT, PREFIX)
    port, _ = ports.take_free_port(PREFIX)
    del lock
    assert port == DEFAULT_PORT + 2 * STEP


def test_the_port_of_a_run_in_another_network_namespace_is_left_to_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Such a run is not heard, but has the folder that one on this port would have."""
    monkeypatch.setenv("TESSERA_KEYS", str(tmp_path))
    monkeypatch.setattr(ports, "_is_silent", lambda _port, _prefix: True)
    elsewhere = run_dir_of(tmp_path, bus_url(DEFAULT_PORT), PREFIX)
    elsewhere.lock("used")
    port, _ = ports.take_free_port(PREFIX)
    assert port == DEFAULT_PORT + STEP
    elsewhere.unlock()
    port, _ = ports.take_free_port(PREFIX)
    assert port == DEFAULT_PORT


def test_stacks_do_not_share_ports() -> None:
    assert STEP >= FIRST_TILE_PORT_OFFSET + MAX_INSTANCES
