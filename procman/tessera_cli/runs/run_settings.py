"""What the options of run, replay and record mean as settings."""

from argparse import Namespace
from pathlib import Path

import yaml

from tessera_cli.cluster.keys import key_folder
from tessera_cli.constants import LIVE_FRAMES_IN_FLIGHT, MAP_SAVE_PERIOD_S
from tessera_cli.errors import UserError
from tessera_cli.files import ROOT, absolute
from tessera_cli.lcm_bus import bus_url
from tessera_cli.membership import run_dir_of
from tessera_cli.runs.sources import Source
from tessera_cli.settings import network_assignments

# REP 103 in the place of the camera: x forward, y left, z up.
FORWARD_LEFT_UP_FROM_CAMERA = [0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0]
MAP_SUFFIX = ".tessera"
# Keys that options of the command line set, with these options.
RESERVED = {
    "evaluator.out_dir": "--out DIR",
    "recorder.path": "--record",
    "camera.source": "SOURCE",
    "tracker.live": "--live",
    "dispatcher.newest_wins": "--live",
    "tracker.replay_log": "replay LOG",
    "mapper.close_loops": "--no-loop-closing",
    "mapper.polish": "--polish",
    "mapper.load_map": "--load-map FILE",
    "evaluator.save_map": "--save-map FILE",
    "tracker.localize_only": "--localize-only",
}


def source_assignments(arguments: Namespace, source: Source, with_color: bool) -> list[str]:
    """Of the camera process. Raises UserError if there is no such calibration file."""
    first, last = arguments.frames
    assignments = [f"camera.sensor={arguments.sensor}", f"camera.first_frame={first}", f"camera.last_frame={last}"]
    if source.has_camera_process:
        assignments.append(f"camera.source={source.text}")
    if with_color and source.has_camera_process:  # no log player knows which frames become keyframes
        assignments.append("camera.color=true")
    if arguments.camera:
        assignments.append(f"camera.calibration={_existing_file('--camera', arguments.camera)}")
    return assignments


def run_assignments(arguments: Namespace, source: Source, out_dir: Path) -> list[str]:
    """All settings of a run that differ from the defaults. Raises UserError if options contradict each other."""
    if source.kind == "bus" and arguments.frames != (0, -1):
        raise UserError("--frames has no effect on bus:, whose frames another program sends.")
    assignments = source_assignments(arguments, source, arguments.color or arguments.occupancy)
    assignments += _bus_assignments(source, arguments.port)
    run_dir = run_dir_of(key_folder(), bus_url(arguments.port), arguments.prefix)
    assignments += [f"bus.run_dir={run_dir.path}", f"bus.camera_is_member={str(source.has_camera_process).lower()}"]
    assignments.append(f"stream.journal_dir={out_dir / 'journal'}")
    assignments += _time_assignments(arguments, source)
    assignments += [f"dispatcher.tiles={arguments.tiles}", f"evaluator.out_dir={out_dir}"]
    if arguments.prefix:
        assignments.append(f"bus.channel_prefix={arguments.prefix}")
    if source.kind == "log":
        assignments.append(f"tracker.replay_log={source.text.removeprefix('log:')}")
    if arguments.record:
        assignments.append(f"recorder.path={out_dir / 'run.lcmlog'}")
    assignments += _map_assignments(arguments) + _body_assignments(arguments, source)
    if arguments.give_up:
        assignments.append(f"camera.give_up_s={arguments.give_up}")
    if arguments.features:
        assignments.append(f"features.num_features={arguments.features}")
    return assignments + user_assignments(arguments)


def _time_assignments(arguments: Namespace, source: Source) -> list[str]:
    """Whether frames are waited for or a newer one takes the place of one that waits."""
    is_live = arguments.live or (source.is_live and arguments.pace != "lockstep")
    pace = arguments.pace or ("realtime" if is_live else "lockstep")
    assignments = [f"camera.pace={pace}"]
    if is_live:
        assignments.append("tracker.live=true")
    if is_live and pace != "lockstep":
        assignments += ["dispatcher.newest_wins=true", f"dispatcher.max_frames_in_flight={LIVE_FRAMES_IN_FLIGHT}"]
    return assignments


def map_path(name: str) -> Path:
    """Of --map: a file if it looks like one, else kept under logs/maps."""
    path = Path(name)
    if len(path.parts) > 1 or path.suffix == MAP_SUFFIX:
        return absolute(name)
    return ROOT / "logs" / "maps" / f"{name}{MAP_SUFFIX}"


def _lasting_map(arguments: Namespace) -> list[str]:
    """It is saved at the end and every minute."""
    if arguments.load_map or arguments.save_map:
        raise UserError("--map loads and saves one map: leave out --load-map and --save-map.")
    path = map_path(arguments.map)
    if path.parent == ROOT / "logs" / "maps":
        path.parent.mkdir(parents=True, exist_ok=True)
    if not path.parent.is_dir():
        raise UserError(f"--map {arguments.map}: there is no folder {path.parent}.")
    saves = [f"evaluator.save_map={path}", f"evaluator.save_period_s={MAP_SAVE_PERIOD_S}"]
    return [] if arguments.localize_only else saves


def saved_map(arguments: Namespace) -> Path | None:
    """The map that the run writes besides that in its folder."""
    if arguments.map and not arguments.localize_only:
        return map_path(arguments.map)
    return absolute(arguments.save_map) if arguments.save_map else None


def loaded_map(arguments: Namespace) -> Path | None:
    """The map that the run begins with; None if there is none yet. Raises UserError if --load-map names no file."""
    if arguments.load_map:
        return _existing_file("--load-map", arguments.load_map)
    path = map_path(arguments.map) if arguments.map else None
    return path if path and path.is_file() else None


def _body_assignments(arguments: Namespace, source: Source) -> list[str]:
    """Whose poses are told: the camera's, or those of the body that carries it."""
    if arguments.axes == "camera":
        return []
    numbers = base_from_camera(_calibration_path(arguments, source))
    if numbers is None and arguments.axes == "ros":
        numbers = FORWARD_LEFT_UP_FROM_CAMERA
    return [f"body.base_from_camera={' '.join(map(str, numbers))}"] if numbers else []


def base_from_camera(path: Path | None) -> list[float] | None:
    """[R | t] row by row, of a calibration file; None if it has none. Other errors are told by the camera process."""
    try:
        document = yaml.safe_load(path.read_text()) if path and path.is_file() else None
    except (OSError, ValueError, yaml.YAMLError):
        return None
    numbers = document.get("base_from_camera") if isinstance(document, dict) else None
    return numbers if isinstance(numbers, list) else None


def _calibration_path(arguments: Namespace, source: Source) -> Path | None:
    """The file that --camera names, or the one beside a video."""
    if arguments.camera:
        return absolute(arguments.camera)
    return Path(source.text.removeprefix("video:")).with_suffix(".yaml") if source.kind == "video" else None


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
        assignments += [f"bus.{bus}_url={main}" for bus in ("main", "camera", "color")]
    return assignments


def _map_assignments(arguments: Namespace) -> list[str]:
    assignments = ["mapper.close_loops=false"] if arguments.no_loop_closing else []
    if arguments.polish:
        if arguments.localize_only:
            raise UserError("--polish has no effect with --localize-only, which leaves the map unchanged.")
        assignments.append("mapper.polish=true")
    if arguments.map:
        assignments += _lasting_map(arguments)
    begins_with = loaded_map(arguments)
    if arguments.localize_only:
        if not begins_with:
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
