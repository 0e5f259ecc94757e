"""The map of a running stack as a PLY file, or its occupancy map: asked of the stages that have them."""

import os
import tempfile
import time
from argparse import Namespace
from pathlib import Path

from tessera_cli.cluster.keys import key_folder
from tessera_cli.console import say
from tessera_cli.constants import LISTEN_S, MAP_WRITER_STOP_TIMEOUT_S, SILENT_STACK_S
from tessera_cli.errors import RunError, UserError
from tessera_cli.files import absolute
from tessera_cli.interrupt import Interrupt
from tessera_cli.lcm_bus import bus_url, is_on_lan
from tessera_cli.membership import MEMBERS_ONLY, RunDir, run_dir_of, secret_of
from tessera_cli.settings import Settings, network_assignments, write_settings
from tessera_cli.supervision.private_deputy import PrivateDeputy, single_process
from tessera_cli.supervision.progress import FINISHED
from tessera_cli.supervision.stack_monitor import StackMonitor, hear_heartbeats
from tessera_cli.supervision.state_folder import LogFolder


def export_map(arguments: Namespace) -> int:
    """`tessera map`."""
    path = absolute(arguments.path)
    if path.is_dir() or not path.parent.is_dir():
        raise UserError(f"{path} can't be written: name a file in a folder that exists.")
    main_url = bus_url(arguments.port)
    run_dir = run_dir_of(key_folder(), main_url, arguments.prefix)
    _require_stack(main_url, arguments.prefix, run_dir)
    assignments = [
        *network_assignments(arguments.port, is_on_lan(arguments)),
        f"bus.channel_prefix={arguments.prefix}",
        *([f"bus.run_dir={run_dir.path}"] if run_dir.secret() else []),
        f"map_writer.path={path}",
        f"map_writer.follow={str(arguments.follow).lower()}",
    ]
    with tempfile.TemporaryDirectory(prefix="tessera-map-") as folder:
        values = write_settings(assignments, Path(folder) / "settings.yaml")
        _write_map(values, Path(folder))
    say(f"the map is in {path}")
    return 0


def _require_stack(main_url: str, channel_prefix: str, run_dir: RunDir) -> None:
    """Raises UserError if there is no stack on the bus that this user may ask."""
    tags = [bytes(heartbeat.header.tag) for heartbeat in hear_heartbeats(main_url, channel_prefix)]
    if not tags:
        raise UserError(
            "no stack runs on this bus: start one, or give its --port N and --prefix TEXT "
            "(and --lan if it is on other machines)."
        )
    if all(any(tag) for tag in tags) and run_dir.secret() is None:
        raise UserError(MEMBERS_ONLY)


def _write_map(values: Settings, folder: Path) -> None:
    # Several may listen at once, each under a name of its own.
    name = f"map_writer_{os.getpid()}"
    logs = LogFolder(folder, f"{folder} is in use.")
    writer = single_process(name, "map_writer", MAP_WRITER_STOP_TIMEOUT_S)
    deputy = PrivateDeputy(logs, folder / "settings.yaml", [writer])
    monitor = StackMonitor(values["bus"]["main_url"], values["bus"]["channel_prefix"], deputy.owns, secret_of(values))
    interrupt = Interrupt()
    try:
        deputy.start()
        _wait(deputy, monitor, interrupt)
        deputy.stop()
    finally:
        deputy.kill()
        if run_dir := values["bus"]["run_dir"]:
            (Path(run_dir) / f"epoch-{name}").unlink(missing_ok=True)  # no process will have this name again
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
