"""tessera map: a late listener that asks the mapper for the map, follows it, and writes it as a cloud of points."""

import os
import tempfile
import time
from argparse import Namespace
from pathlib import Path

from tessera_cli import settings
from tessera_cli.errors import RunFailed, UserError
from tessera_cli.interrupt import Interrupt
from tessera_cli.lcm_bus import ttl_of
from tessera_cli.supervision.private_deputy import PrivateDeputy, helper
from tessera_cli.supervision.progress import FINISHED
from tessera_cli.supervision.stack_monitor import BusListener
from tessera_cli.supervision.state_folder import LogFolder

# A living stage tells its status twice a second.
SILENT_BUS_S = 5.0
LISTEN_MS = 50
STOP_TIME_S = 5.0


def main(arguments: Namespace) -> int:
    path = Path(arguments.path).expanduser().absolute()
    if path.is_dir() or not path.parent.is_dir():
        raise UserError(f"{path} can't be written: name a file in a folder that exists.")
    make = settings.lan_assignments if ttl_of(arguments) else settings.port_assignments
    assignments = make(arguments.port) + [
        f"bus.channel_prefix={arguments.prefix}",
        f"map_writer.path={path}",
        f"map_writer.follow={str(arguments.follow).lower()}",
    ]
    with tempfile.TemporaryDirectory(prefix="tessera-map-") as folder:
        values = settings.write_settings(assignments, Path(folder) / "settings.yaml")
        _write_map(values, Path(folder))
    print(f"tessera: the map is in {path}")
    return 0


def _write_map(values: dict, folder: Path) -> None:
    # Several may listen at once, each under a name of its own.
    name = f"map_writer_{os.getpid()}"
    deputy = PrivateDeputy(
        LogFolder(folder, f"{folder} is in use."), folder / "settings.yaml", [helper(name, "map_writer", STOP_TIME_S)]
    )
    bus = BusListener(values["bus"]["main_url"], values["bus"]["channel_prefix"], deputy.owns)
    if bus.is_free():
        raise UserError(
            "no stack runs on this bus: start one, or give its --port N and --prefix TEXT (and --lan if it is on other machines)."
        )
    interrupt = Interrupt()
    try:
        deputy.start()
        _wait(deputy, bus, interrupt)
        deputy.end()
    finally:
        deputy.kill()
    print(f"tessera: {deputy.last_words(name)}", flush=True)


def _wait(deputy: PrivateDeputy, bus: BusListener, interrupt: Interrupt) -> None:
    """Until the map is written."""
    began = time.monotonic()
    while not deputy.is_over:
        bus.listen(LISTEN_MS)
        deputy.step()
        report = next(iter(bus.progress.stages.values()), None)
        if report is not None and report.state == FINISHED:
            return
        if interrupt.requested:
            raise RunFailed("interrupted before the map was written.")
        if time.monotonic() - max(began, bus.others_heard_at) > SILENT_BUS_S:
            raise RunFailed("the stack has ended before the whole map was here.")
