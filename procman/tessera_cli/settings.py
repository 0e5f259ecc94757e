"""The settings of one run: defaults, what the options say, and --set on top, checked and merged by tessera-settings."""

import subprocess
from argparse import Namespace
from pathlib import Path

import yaml

from tessera_cli.errors import UserError
from tessera_cli.files import BIN, ROOT
from tessera_cli.runs.sources import Source

GROUP = "239.255.76.67"
# A message that fits one packet of a LAN: the loss of a fragment would lose it whole.
LAN_MESSAGE_BYTES = 1400
FIRST_TILE_PORT_OFFSET = 13  # from the base port: 7667 -> 7680
# Keys that the command itself fills in.
RESERVED = {
    "evaluator.out_dir": "--out DIR",
    "recorder.path": "--record",
    "camera.source": "SOURCE",
    "tracker.live": "--live",
    "tracker.replay_log": "replay LOG",
    "mapper.close_loops": "--no-loop-closing",
    "mapper.load_map": "--load-map FILE",
    "evaluator.save_map": "--save-map FILE",
    "tracker.localize_only": "--localize-only",
}


def bus_url(port: int) -> str:
    """Multicast that stays on this machine."""
    return f"udpm://{GROUP}:{port}?ttl=0"


def port_assignments(port: int) -> list[str]:
    return [
        f"bus.main_url={bus_url(port)}",
        f"bus.camera_url={bus_url(port + 1)}",
        f"bus.work_url={bus_url(port + 2)}",
        f"bus.first_tile_port={port + FIRST_TILE_PORT_OFFSET}",
    ]


def lan_assignments(port: int) -> list[str]:
    """As port_assignments, but for messages that leave this machine."""
    tile_url = f"bus.tile_url=udpm://{GROUP}:{{port}}?ttl=1"
    return [text.replace("?ttl=0", "?ttl=1") for text in port_assignments(port)] + [
        tile_url,
        f"bus.max_message_bytes={LAN_MESSAGE_BYTES}",
    ]


def bus_assignments(source: Source, port: int) -> list[str]:
    assignments = port_assignments(port)
    if source.kind == "bus":
        # A log player publishes all channels of its log on one bus.
        main = source.text or bus_url(port)
        assignments += [f"bus.main_url={main}", f"bus.camera_url={main}"]
    return assignments


def source_assignments(arguments: Namespace, source: Source) -> list[str]:
    first, last = arguments.frames
    assignments = [f"camera.sensor={arguments.sensor}", f"camera.first_frame={first}", f"camera.last_frame={last}"]
    if source.has_camera_process:
        assignments.append(f"camera.source={source.text}")
    if arguments.camera:
        path = Path(arguments.camera).expanduser().absolute()
        if not path.is_file():
            raise UserError(f"--camera {arguments.camera}: there is no file {path}.")
        assignments.append(f"camera.calibration={path}")
    return assignments


def run_assignments(arguments: Namespace, source: Source, out_dir: Path) -> list[str]:
    pace = arguments.pace or ("realtime" if source.is_live else "lockstep")
    if source.kind == "bus" and arguments.frames != (0, -1):
        raise UserError("--frames has no effect on bus:, whose frames another program sends.")
    assignments = source_assignments(arguments, source) + bus_assignments(source, arguments.port)
    assignments += [f"camera.pace={pace}", f"dispatcher.tiles={arguments.tiles}", f"evaluator.out_dir={out_dir}"]
    if arguments.prefix:
        assignments.append(f"bus.channel_prefix={arguments.prefix}")
    if arguments.live:
        assignments.append("tracker.live=true")
    if source.kind == "log":
        assignments.append(f"tracker.replay_log={source.text.removeprefix('log:')}")
    if arguments.record:
        assignments.append(f"recorder.path={out_dir / 'run.lcmlog'}")
    assignments += map_assignments(arguments)
    if arguments.features:
        assignments.append(f"features.num_features={arguments.features}")
    return assignments + user_assignments(arguments)


def map_assignments(arguments: Namespace) -> list[str]:
    assignments = ["mapper.close_loops=false"] if arguments.no_loop_closing else []
    if arguments.load_map:
        path = Path(arguments.load_map).expanduser().absolute()
        if not path.is_file():
            raise UserError(f"--load-map {arguments.load_map}: there is no file {path}.")
        assignments.append(f"mapper.load_map={path}")
    if arguments.localize_only:
        if not arguments.load_map:
            raise UserError("--localize-only needs a map: give --load-map FILE, the map.tessera of an earlier run.")
        assignments.append("tracker.localize_only=true")
    if arguments.save_map:
        path = Path(arguments.save_map).expanduser().absolute()
        if not path.parent.is_dir():
            raise UserError(f"--save-map {arguments.save_map}: there is no folder {path.parent}.")
        assignments.append(f"evaluator.save_map={path}")
    return assignments


def user_assignments(arguments: Namespace) -> list[str]:
    for text in arguments.settings:
        key = text.partition("=")[0]
        if key in RESERVED:
            raise UserError(f"--set {text}: give {RESERVED[key]} instead.")
    return arguments.settings


def prefix_of(assignments: list[str]) -> str:
    """The channel prefix that --set asks for."""
    values = [text.partition("=")[2] for text in assignments if text.startswith("bus.channel_prefix=")]
    return values[-1] if values else ""


def write_settings(assignments: list[str], path: Path) -> dict:
    """Writes all settings to `path` and returns them as sections of keys."""
    command = [BIN / "tessera-settings", "--defaults", ROOT / "config" / "default.yaml", "--out", path]
    for assignment in assignments:
        command += ["--set", assignment]
    merged = subprocess.run(command, capture_output=True, text=True)
    if merged.returncode != 0:
        raise UserError(merged.stderr.strip())
    return yaml.safe_load(path.read_text())
