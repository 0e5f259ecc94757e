"""`tessera export`."""

from argparse import Namespace
from pathlib import Path

import numpy as np

from tessera_cli.console import say
from tessera_cli.errors import UserError
from tessera_cli.export import colmap
from tessera_cli.files import absolute, replacing, replacing_folder
from tessera_cli.maps.landmark_colors import read_colors
from tessera_cli.maps.map_file import read_map_file
from tessera_cli.maps.map_replica import MapReplica
from tessera_cli.runs.recorded_images import recording_of
from tessera_cli.runs.run_folder import Result, read_run


def export_run(arguments: Namespace) -> int:
    """What is written is told by the target's name: OUT.mcap, or a folder for COLMAP."""
    folder, target = absolute(arguments.run), absolute(arguments.target)
    if not folder.is_dir():
        raise UserError(f"{folder}: there is no such folder; give the folder of a run.")
    result, replica = read_run(folder), read_map_file(folder / "map.tessera")
    if result.estimate is None or not replica.keyframes:
        raise UserError(f"{folder}: no frame was tracked, so that there is nothing to export.")
    if (arguments.format or ("mcap" if target.suffix == ".mcap" else "colmap")) == "mcap":
        _export_mcap(folder, target, result, replica)
    else:
        _export_colmap(folder, target, result, replica)
    return 0


def _export_mcap(folder: Path, target: Path, result: Result, replica: MapReplica) -> None:
    from tessera_cli.export.mcap_file import entries_of, write_mcap

    if target.is_dir() or not target.parent.is_dir():
        raise UserError(f"{target} can't be written: name a file in a folder that exists.")
    with replacing(target) as written:
        count = write_mcap(written, entries_of(folder, result, replica))
    say(f"{count} messages, {target.stat().st_size / 1e6:.1f} MB in {target}")
    if not recording_of(folder, result.settings):
        say("without images: the run was not recorded (run --record)")


def _export_colmap(folder: Path, target: Path, result: Result, replica: MapReplica) -> None:
    if target.is_file() or not target.parent.is_dir():
        raise UserError(f"{target} can't be made: name a new folder in one that exists, or a file that ends in .mcap.")
    if target.is_dir() and any(entry.name not in colmap.CONTENT for entry in target.iterdir()):
        raise UserError(f"{target} has other files than those of a model of COLMAP: name a new folder.")
    model, colors = colmap.model_of(replica), None
    recording = recording_of(folder, result.settings)
    with replacing_folder(target) as written:
        if recording:
            (written / colmap.IMAGES).mkdir()
            colors = colmap.write_images(model, written / colmap.IMAGES, *recording)
        if (of_map := read_colors(folder, replica)) is not None:
            colors = of_map[np.isin(replica.landmark_ids(), model.landmarks)]
        colmap.write_model(model, written, colors)
    error = float(model.errors_px.mean()) if len(model.errors_px) else 0.0
    say(f"{len(model.keyframes)} images, {len(model.landmarks)} points, mean error {error:.2f} px in {target}")
    if len(model.keyframes) < len(replica.keyframes):
        left_out = len(replica.keyframes) - len(model.keyframes)
        say(f"{left_out} keyframes are left out: they are in parts of the map that no loop has joined to the largest")
    if not recording:
        say("without images: the run was not recorded (run --record); images.txt has their names")
