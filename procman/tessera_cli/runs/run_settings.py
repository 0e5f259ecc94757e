"""What the options of run, replay and record mean as settings."""

from argparse import Namespace
from pathlib import Path

from tessera_cli.cluster.keys import key_folder
from tessera_cli.errors import UserError
from tessera_cli.files import absolute
from tessera_cli.lcm_bus import bus_url
from tessera_cli.membership import run_dir_of
from tessera_cli.runs.sources import Source
from tessera_cli.settings import network_assignments

# Keys that options of the command line set, with these options.
RESERVED = {
    "evaluator.out_dir": "--out DIR",
    "recorder.path": "--record",
    "camera.source": "SOURCE",
    "tracker.live": "--live",
    "tracker.replay_log": "replay LOG",
    "mapper.close_loops": "--no-loop-closing",
    "mapper.polish": "--polish",
    "mapper.load_map": "--load-map FILE",
    "evaluator.save_map": "--save-map FILE",
    "tracker.localize_only": "--localize-only",
}


def source_assignments(arguments: Namespace, source: Source) -> list[str]:
    """Of the camera process. Raises UserError if there is no such calibration file."""
    first, last = arguments.frames
    assignments = [f"camera.sensor={arguments.sensor}", f"camera.first_frame={first}", f"camera.last_frame={last}"]
    if source.has_camera_process:
        assignments.append(f"camera.source={source.text}")
    if arguments.camera:
        assignments.append(f"camera.calibration={_existing_file('--camera', arguments.camera)}")
    return assignments


def run_assignments(arguments: Namespace, source: Source, out_dir: Path) -> list[str]:
    """All settings of a run that differ from the defaults. Raises UserError if options contradict each other."""
    if source.kind == "bus" and arguments.frames != (0, -1):
        raise UserError("--frames has no effect on bus:, whose frames another program sends.")
    pace = arguments.pace or ("realtime" if source.is_live else "lockstep")
    assignments = source_assignments(arguments, source) + _bus_assignments(source, arguments.port)
    assignments += [f"camera.pace={pace}", f"dispatcher.tiles={arguments.tiles}", f"evaluator.out_dir={out_dir}"]
    run_dir = run_dir_of(key_folder(), bus_url(arguments.port), arguments.prefix)
    assignments += [f"bus.run_dir={run_dir.path}", f"bus.camera_is_member={str(source.has_camera_process).lower()}"]
    if arguments.prefix:
        assignments.append(f"bus.channel_prefix={arguments.prefix}")
    if arguments.live:
        assignments.append("tracker.live=true")
    if source.kind == "log":
        assignments.append(f"tracker.replay_log={source.text.removeprefix('log:')}")
    if arguments.record:
        assignments.append(f"recorder.path={out_dir / 'run.lcmlog'}")
    assignments += _map_assignments(arguments)
    if arguments.features:
        assignments.append(f"features.num_features={arguments.features}")
    return assignments + user_assignments(arguments)


def user_assignments(arguments: Namespace) -> list[str]:
    """Those of --set. Raises UserError for keys that have an option of their own."""
    for text in arguments.settings:
        key = text.partition("=")[0]
        if key in RESERVED:
            raise UserError(f"--set {text}: give {RESERVED[key]} instead.")
    return arguments.settings


def _bus_assignments(source: Source, port: int) -> list[str]:
    assignments = network_assignments(port, on_lan=False)
    if source.kind == "bus":
        # A log player publishes all channels of its log on one bus.
        main = source.text or bus_url(port)
        assignments += [f"bus.main_url={main}", f"bus.camera_url={main}"]
    return assignments


def _map_assignments(arguments: Namespace) -> list[str]:
    assignments = ["mapper.close_loops=false"] if arguments.no_loop_closing else []
    if arguments.polish:
        if arguments.localize_only:
            raise UserError("--polish has no effect with --localize-only, which leaves the map unchanged.")
        assignments.append("mapper.polish=true")
    if arguments.load_map:
        assignments.append(f"mapper.load_map={_existing_file('--load-map', arguments.load_map)}")
    if arguments.localize_only:
        if not arguments.load_map:
            raise UserError("--localize-only needs a map: give --load-map FILE, the map.tessera of an earlier run.")
        assignments.append("tracker.localize_only=true")
    if arguments.save_map:
        path = absolute(arguments.save_map)
        if not path.parent.is_dir():
            raise UserError(f"--save-map {arguments.save_map}: there is no folder {path.parent}.")
        assignments.append(f"evaluator.save_map={path}")
    return assignments


def _existing_file(option: str, text: str) -> Path:
    path = absolute(text)
    if not path.is_file():
        raise UserError(f"{option} {text}: there is no file {path}.")
    return path
