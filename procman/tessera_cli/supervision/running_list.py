"""One process list as a deputy runs it: its settings, and the bus on which its stages say how they are."""

import os
from collections.abc import Callable
from dataclasses import dataclass

from tessera_cli.lcm_bus import Bus
from tessera_cli.messages import stage_status_t
from tessera_cli.supervision.progress import FINISHED, RUNNING


@dataclass(frozen=True)
class RunningList:
    name: str
    run: str  # digest of the settings
    main_url: str
    channel_prefix: str
    bus: Bus


def listen_to(
    name: str, run: str, settings: dict, publisher: str, on_stage: Callable[[str, stage_status_t], None]
) -> RunningList:
    """`on_stage` gets the list's name and each status of a stage of this machine that runs. Raises RunFailed if the bus can't be opened."""

    def on_status(status: stage_status_t) -> None:
        if status.host == os.uname().nodename and RUNNING <= status.state <= FINISHED:
            on_stage(name, status)

    bus = Bus(settings["bus"]["main_url"], publisher)
    bus.subscribe(settings["bus"]["channel_prefix"] + "STATUS", stage_status_t, on_status)
    return RunningList(name, run, settings["bus"]["main_url"], settings["bus"]["channel_prefix"], bus)
