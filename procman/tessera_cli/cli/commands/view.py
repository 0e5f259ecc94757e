"""tessera view: the 3-D view of a run, or of a running stack."""

from argparse import Namespace

from tessera_cli.cli.options import add_lan
from tessera_cli.cli.parsing import Commands, add_command, whole_number

EPILOG = """\
Shown are the path of the camera and its truth, keyframes, which of them see the same, landmarks, loops, the occupancy
map, the image with its keypoints (green tracked, blue new, red lost) and the borders of tiles, and curves of latency,
queues and inliers. A view listens: it may miss messages, and changes nothing. It is drawn by the rerun package, which
is installed when `view` is first called (some 230 MB). Images of a run are there if it was recorded (run --record).

examples:
  procman/tessera view                        the stack that runs on this machine, now or later
  procman/tessera view logs/mh01
  procman/tessera view --lan --prefix B_      a stack on other machines
  procman/tessera view logs/mh01 --web        in a browser; without a display this is the default
  procman/tessera view logs/mh01 --save mh01.rrd
"""


def add_parser(commands: Commands) -> None:
    parser = add_command(commands, "view", main, "The 3-D view of a run, or of a running stack.", EPILOG)
    parser.add_argument(
        "run", metavar="RUN", nargs="?", help="a run's folder, or a file of --save; without it: the running stack"
    )
    parser.add_argument("--web", action="store_true", help="in a browser on this machine, not in a window")
    parser.add_argument(
        "--web-port", type=whole_number(1024, 65535), metavar="N", default=9090, help="of the web page, default 9090"
    )
    parser.add_argument("--save", metavar="FILE.rrd", help="write what is shown; without a window, but for --web")
    parser.add_argument(
        "--no-images", action="store_true", help="live: don't receive images, which take much bandwidth"
    )
    parser.add_argument("--prefix", metavar="TEXT", default="", help="live: the stack's bus.channel_prefix")
    add_lan(parser)


def main(arguments: Namespace) -> int:
    if arguments.run:
        from tessera_cli.viewing.view_run import view_run

        return view_run(arguments)
    from tessera_cli.viewing.view_bus import view_bus

    return view_bus(arguments)
