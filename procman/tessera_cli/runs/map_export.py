"""The map of a running stack as a PLY file, or its occupancy map: asked of the stages that have them."""

import os
import tempfile
import time
from argparse import Namespace
from pathlib import Path

from tessera_cli.console import say
from tessera_cli.constants import LISTEN_S, MAP_WRITER_STOP_TIMEOUT_S, SILENT_STACK_S
from tessera_cli.errors import RunError, UserError
from tessera_cli.files import absolute
from tessera_cli.interrupt import Interrupt
from tessera_cli.lcm_bus import is_on_lan
from tessera_cli.settings import Settings, network_assignments, write_settings
from tessera_cli.supervision.private_deputy import PrivateDeputy, single_process
from tessera_cli.supervision.progress import FINISHED
from tessera_cli.supervision.stack_monitor import StackMonitor
from tessera_cli.supervision.state_folder import LogFolder


def export_map(arguments: Namespace) -> int:
    """`tessera map`."""
    path = absolute(arguments.path)
    if path.is_dir() or not path.parent.is_dir():
        raise UserError(f"{path} can't be written: name a file in a folder that exists.")
    assignments = [
        *network_assignments(arguments.port, is_on_lan(arguments)),
        f"bus.channel_prefix={arguments.prefix}",
        f"map_writer.path={path}",
        f"map_writer.follow={str(arguments.follow).lower()}",
    ]
    with tempfile.TemporaryDirectory(prefix="tessera-map-") as folder:
        values = write_settings(assignments, Path(folder) / "settings.yaml")
        _write_map(values, Path(folder))
    say(f"the map is in {path}")
    return 0


def _write_map(values: Settings, folder: Path) -> None:
    # Several may listen at once, each under a name of its own.
    name = f"map_writer_{os.getpid()}"
    logs = LogFolder(folder, f"{folder} is in use.")
    writer = single_process(name, "map_writer", MAP_WRITER_STOP_TIMEOUT_S)
    deputy = PrivateDeputy(logs, folder / "settings.yaml", [writer])
    monitor = StackMonitor(values["bus"]["main_url"], values["bus"]["channel_prefix"], deputy.owns)
    if monitor.is_free():
        raise UserError(
            "no stack runs on this bus: start one, or give its --port N and --prefix TEXT "
            "(and --lan if it is on other machines)."
        )
    interrupt = Interrupt()
    try:
        deputy.start()
        _wait(deputy, monitor, interrupt)
        deputy.stop()
    finally:
        deputy.kill()
    say(deputy.last_line(name))


def _wait(deputy: PrivateDeputy, monitor: StackMonitor, interrupt: Interrupt) -> None:
    """Until the map is written."""
    began = time.monotonic()
    while not deputy.is_over:
        monitor.listen(LISTEN_S)
        deputy.step()
        report = next(iter(monitor.progress.stages.values()), None)
        if report is not None and report.state == FINISHED:
            return
        if interrupt.requested:
            raise RunError("interrupted before the map was written.")
        if time.monotonic() - max(began, monitor.others_heard_at) > SILENT_STACK_S:
            raise RunError("the stack ended before the whole map was received.")
