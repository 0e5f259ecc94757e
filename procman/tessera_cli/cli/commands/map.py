"""tessera map: the map of a running stack as a point cloud, or its occupancy map."""

from argparse import Namespace

from tessera_cli.cli.options import add_lan
from tessera_cli.cli.parsing import Commands, add_command

EPILOG = """\
The ending of the file's name says what is written:
  .ply         the landmarks; any viewer of point clouds opens the file: MeshLab, CloudCompare, Blender. In color as
               far as the camera of a run with --color still has the images of keyframes (the newest 64 MB)
  .bt          the occupancy map of a stack that runs with --occupancy, for octovis
  .ot          the same with the colors of the images
  .pgm         its 2-D grid, with a .yaml beside it, as ROS's map_server reads it

examples:
  procman/tessera map /tmp/now.ply
  procman/tessera map /tmp/whole.ply --follow
  procman/tessera map /tmp/now.bt
  procman/tessera map /tmp/robot_b.ply --prefix B_ --lan
"""


def add_parser(commands: Commands) -> None:
    summary = "Joins a running stack and writes its map: a point cloud, or an occupancy map."
    parser = add_command(commands, "map", main, summary, EPILOG)
    parser.add_argument("path", metavar="OUT.ply|.bt|.ot|.pgm", help="the file to write")
    parser.add_argument("--follow", action="store_true", help="write when the run has ended, not at once; PLY only")
    parser.add_argument("--prefix", metavar="TEXT", default="", help="the stack's bus.channel_prefix, where it has one")
    add_lan(parser)


def main(arguments: Namespace) -> int:
    from tessera_cli.runs.map_export import export_map

    return export_map(arguments)
