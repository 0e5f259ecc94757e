"""One process list as a deputy runs it: its settings, and the bus on which its stages report."""

import os
from collections.abc import Callable
from dataclasses import dataclass

from tessera_cli.constants import STATUS
from tessera_cli.lcm_bus import Bus
from tessera_cli.membership import secret_of
from tessera_cli.messages import stage_status_t
from tessera_cli.settings import Settings


@dataclass(frozen=True)
class RunningList:
    """A list and the bus of its stages."""

    name: str
    run: str  # digest of the settings
    main_url: str
    channel_prefix: str
    bus: Bus
    keys: frozenset[bytes]  # of the deputies that have processes of the list


def listen_to(
    name: str,
    run: str,
    settings: Settings,
    keys: frozenset[bytes],
    publisher: str,
    on_stage: Callable[[str, stage_status_t], None],
) -> RunningList:
    """`on_stage` gets the list's name and each status of a running or finished stage of this machine.

    `keys`: of the deputies of the list. Raises RunError if the bus can't be opened.
    """

    def on_status(status: stage_status_t) -> None:
        is_up = status.state in (stage_status_t.RUNNING, stage_status_t.FINISHED)
        if status.host == os.uname().nodename and is_up:
            on_stage(name, status)

    main_url, prefix = settings["bus"]["main_url"], settings["bus"]["channel_prefix"]
    bus = Bus(main_url, publisher)
    bus.subscribe(prefix + STATUS, stage_status_t, on_status, secret_of(settings))
    return RunningList(name, run, main_url, prefix, bus, keys)
