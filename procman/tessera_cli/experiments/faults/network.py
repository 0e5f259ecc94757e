"""A network of this process's own, on which packets can be lost without disturbing the machine's. Needs root."""

import ctypes
import os

from tessera_cli.errors import RunError
from tessera_cli.experiments.distribution.lan import ip, loss_rules, run_tool

LOSS_PERCENT = 2
CLONE_NEWNET = 0x40000000  # <sched.h>


def enter_own_network() -> None:
    """This process and those that it starts from now on share a loopback with nobody else; it ends with them.

    To be called before threads are started. Raises RunError if this machine makes no namespaces.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(CLONE_NEWNET) != 0:
        raise RunError(f"this machine makes no network namespace: {os.strerror(ctypes.get_errno())}.")
    ip("link", "set", "lo", "multicast", "on", "up")
    ip("route", "add", "224.0.0.0/4", "dev", "lo")


def lose(percent: int) -> None:
    """From now on, so much of what arrives is lost, at random. 0: nothing."""
    run_tool("nft", loss_rules(percent, ["lo"]))
