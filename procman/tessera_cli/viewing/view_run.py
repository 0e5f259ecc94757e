"""`tessera view RUN`."""

from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path

from tessera_cli.errors import UserError
from tessera_cli.files import absolute
from tessera_cli.maps.landmark_colors import read_colors
from tessera_cli.maps.map_file import read_map_file
from tessera_cli.maps.map_replica import MapReplica
from tessera_cli.runs.recorded_images import recording_of
from tessera_cli.runs.run_folder import Result, read_run
from tessera_cli.viewing.occupancy import occupancy_of
from tessera_cli.viewing.run_scene import keyframe_keypoints, keyframe_pictures, look_of, scene_of
from tessera_cli.viewing.scene import Shown
from tessera_cli.viewing.window import open_view, show_recording


def view_run(arguments: Namespace) -> int:
    """Shows the folder until the window is closed."""
    folder = absolute(arguments.run)
    if folder.suffix == ".rrd":
        show_recording(arguments, folder)
        return 0
    if not folder.is_dir():
        raise UserError(f"{folder}: there is no such folder; give the folder of a run.")
    if not (folder / "map.tessera").is_file():
        raise UserError(f"{folder} holds no map.tessera: is it the folder of a run that ended?")
    with open_view(arguments, folder.name) as view:
        result, replica = read_run(folder), read_map_file(folder / "map.tessera")
        if result.estimate is None:
            raise UserError(f"{folder}: no frame was tracked, so that there is nothing to show.")
        sink = view.start(look_of(result, replica))
        for shown in scene_of(result, replica, read_colors(folder, replica)):
            sink.show(shown)
        view.tell()
        for shown in later(folder, result, replica):
            if view.is_over:
                if arguments.save:
                    raise KeyboardInterrupt  # no file with a part of the view
                break
            sink.show(shown)
        view.wait()
    return 0


def later(folder: Path, result: Result, replica: MapReplica) -> Iterator[Shown]:
    """What takes long to read, shown when the rest is there."""
    yield from occupancy_of(result)
    yield from keyframe_keypoints(result, replica)
    if recording := recording_of(folder, result.settings):
        yield from keyframe_pictures(result, replica, *recording)
