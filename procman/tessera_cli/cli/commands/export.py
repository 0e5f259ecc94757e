"""tessera export: a run in the formats of other programs."""

from argparse import Namespace

from tessera_cli.cli.parsing import Commands, add_command

EPILOG = """\
OUT.mcap is for Foxglove: path, truth, keyframes, landmarks, transforms, the occupancy grid, curves and, of a run that
was recorded (run --record), images and calibration. Any other name is a folder for COLMAP's text model (cameras.txt,
images.txt, points3D.txt, images/), for dense reconstruction or splatting; it has the largest part of the map. Of a run
with --color, points are in color, and of one that was also recorded, images of keyframes.

examples:
  procman/tessera export logs/mh01 mh01.mcap
  procman/tessera export logs/mh01 mh01_model
"""


def add_parser(commands: Commands) -> None:
    parser = add_command(commands, "export", main, "A run for Foxglove (MCAP), or as COLMAP's text model.", EPILOG)
    parser.add_argument("run", metavar="RUN", help="a run's folder")
    parser.add_argument("target", metavar="OUT.mcap|OUTDIR", help="what to write; its name tells the format")
    parser.add_argument("--format", choices=("mcap", "colmap"), help="where the name should not tell it")


def main(arguments: Namespace) -> int:
    from tessera_cli.export.export_run import export_run

    return export_run(arguments)
