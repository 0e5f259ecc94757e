"""tessera run: the whole stack on this machine, fed by a source."""

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from tessera_cli.cli.options import SOURCES, add_run_options
from tessera_cli.cli.parsing import Commands, add_command

if TYPE_CHECKING:
    from tessera_cli.runs.run_folder import Result

EXAMPLES = """
examples:
  procman/tessera run kitti:data/kitti/sequences/03 --extractors 2 --tiles 2x2
  procman/tessera run euroc:data/MH_01 --sensor stereo --out logs/mh01
  procman/tessera run video:drive.mp4 --camera my_camera.yaml --frames 100:600
  procman/tessera run bus: & .venv/bin/lcm-logplayer drive.lcmlog
"""


def add_parser(commands: Commands) -> None:
    summary = "The whole stack on this machine, until the source ends or Ctrl-C."
    parser = add_command(commands, "run", main, summary, SOURCES + EXAMPLES)
    parser.add_argument("source", metavar="SOURCE", help="see below")
    add_run_options(parser)


def main(arguments: Namespace) -> int:
    from tessera_cli.runs.launcher import run_stack

    return run_stack(arguments, present)


def present(result: "Result", folder: Path) -> str:
    """Imports matplotlib, which takes a second, only when the run is over."""
    from tessera_cli.report.run_report import present_run

    return present_run(result, folder)
