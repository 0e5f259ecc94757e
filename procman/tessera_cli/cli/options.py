"""Options that several commands share."""

import os

from tessera_cli.cli.parsing import SENSORS, Parser, assignment, frames, pace, seconds, tiles, whole_number
from tessera_cli.constants import DEFAULT_PORT, MAX_FEATURES, MAX_INSTANCES

SOURCES = """\
SOURCE is one of
  kitti:DIR    a sequence folder of the KITTI odometry benchmark
  euroc:DIR    holds mav0/
  tum:DIR      TUM RGB-D: rgb.txt, depth.txt, groundtruth.txt
  video:FILE   any video file that OpenCV reads; needs --camera, or FILE.yaml beside it
  camera:N     V4L2 device /dev/videoN; needs --camera
  rtsp://...   network stream; needs --camera
  sim:NAME     a simulated world with exact truth: street, street-short, country, walk, room, desk or
               robot; options after it: sim:street,seed=3,length=500 (also speed=, noise=, scale= as
               factors, duration= of room and desk in s, readout= of a rolling shutter in ms, path=FILE
               of KITTI poses)
  log:FILE     a log recorded by `tessera record`, `tessera run --record` or lcm-logger
  bus:[URL]    frames that another program, such as lcm-logplayer, publishes; default: this stack's main bus
"""


def add_features(parser: Parser) -> None:
    count = whole_number(1, MAX_FEATURES)
    parser.add_argument("--features", type=count, metavar="N", help="keypoints per image, default 2000")


def add_settings(parser: Parser) -> None:
    parser.add_argument(
        "--set",
        dest="settings",
        type=assignment,
        metavar="section.key=value",
        action="append",
        default=[],
        help="any setting of config/default.yaml; may be repeated",
    )


def add_force(parser: Parser, what: str) -> None:
    parser.add_argument("--force", action="store_true", help=what)


def add_port(parser: Parser) -> None:
    parser.add_argument(
        "--port",
        type=whole_number(1024, 65000),
        metavar="N",
        default=DEFAULT_PORT,
        help=f"base port of the buses, for a second stack on one machine; default {DEFAULT_PORT}",
    )


def add_free_port(parser: Parser) -> None:
    """Of commands that start a stack: None without the option."""
    parser.add_argument(
        "--port",
        type=whole_number(1024, 65000),
        metavar="N",
        help=f"base port of the buses; default {DEFAULT_PORT}, or the next that is free, which is printed then",
    )


def add_lan(parser: Parser) -> None:
    """--lan and --port."""
    parser.add_argument(
        "--lan",
        action="store_true",
        help="use the network (ttl 1), not this machine alone; TESSERA_LAN=1 in the environment does the same",
    )
    add_port(parser)


def add_timeout(parser: Parser, seconds: int) -> None:
    parser.add_argument(
        "--timeout",
        type=whole_number(1, 86400),
        metavar="S",
        default=seconds,
        help=f"seconds to wait, default {seconds}",
    )


def add_frames(parser: Parser, remark: str = "") -> None:
    """`remark` goes on with the help, as does that of `add_extractors`."""
    parser.add_argument("--frames", type=frames, metavar="A:B", default=(0, -1), help="only frames A..B-1" + remark)


def add_extractors(parser: Parser, minimum: int, remark: str = "") -> None:
    parser.add_argument(
        "--extractors",
        type=whole_number(minimum, MAX_INSTANCES),
        metavar="P",
        default=os.cpu_count() or 1,
        help="extractor processes, default: cores of this machine" + remark,
    )


def add_source_options(parser: Parser) -> None:
    """Of commands that read a source."""
    parser.add_argument("--sensor", choices=SENSORS, default="mono", help="default mono")
    parser.add_argument(
        "--camera", metavar="FILE.yaml", help="calibration, where the source brings none, or instead of its own"
    )
    parser.add_argument(
        "--color",
        action="store_true",
        help="keep the colors of the images, where they have any: landmarks, map.ply, views, exports and the occupancy "
        "map show them; --occupancy turns it on; poses and map are the same",
    )
    add_frames(parser)
    add_settings(parser)


def add_run_options(parser: Parser) -> None:
    """Of commands that run the whole stack."""
    add_source_options(parser)
    add_extractors(parser, 0, "; 0: those of a running pool (procman/pool.pmd)")
    parser.add_argument(
        "--prefix",
        metavar="TEXT",
        default="",
        help="before every channel's name, such as a_, for several robots on one bus",
    )
    parser.add_argument(
        "--tiles",
        type=tiles,
        metavar="LxC",
        default="1x1",
        help="lines x columns into which images are cut, default 1x1",
    )
    add_features(parser)
    parser.add_argument(
        "--pace",
        type=pace,
        metavar="lockstep|realtime|X",
        help="default lockstep for files, realtime for cameras and --live; X is a speed factor; with bus:, lockstep "
        "takes frames in their order instead of the newest",
    )
    parser.add_argument("--out", metavar="DIR", help="the run's folder, default logs/<date-time>-<source name>")
    add_force(parser, "an earlier run in --out DIR may be replaced")
    parser.add_argument(
        "--live",
        action="store_true",
        help="as with cameras, which always do so: the newest frame wins, a waiting one is dropped for it, and the "
        "tracker never waits for the mapper; a file is read at its own pace; a recording can be replayed exactly",
    )
    parser.add_argument(
        "--give-up",
        type=seconds,
        metavar="SECONDS",
        default=0.0,
        help="end the run when a camera or stream has sent nothing for so long; default: wait until it is back",
    )
    parser.add_argument(
        "--axes",
        choices=("ros", "camera"),
        help="ros: poses of a body with x forward, y left, z up, placed by base_from_camera of the camera's file, or "
        "where the camera is; camera: of the camera, x right, y down, z forward; default ros if the file has "
        "base_from_camera, else camera",
    )
    _add_map_options(parser)
    parser.add_argument(
        "--occupancy",
        action="store_true",
        help="make an occupancy map of what the keyframes see: occupancy.bt (for octovis), .ot, and a 2-D grid .pgm",
    )
    parser.add_argument("--record", action="store_true", help="all channels into DIR/run.lcmlog")
    add_free_port(parser)


def _add_map_options(parser: Parser) -> None:
    parser.add_argument("--no-loop-closing", action="store_true", help="don't correct the map where a loop closes")
    parser.add_argument(
        "--polish",
        action="store_true",
        help="adjust the whole map once more when the run ends, also without loops; trajectory_live.txt stays",
    )
    parser.add_argument(
        "--map",
        metavar="NAME",
        help="a map that lasts: loaded if it exists, continued, saved every minute and at the end; NAME is a file "
        "(.tessera), or a name under logs/maps",
    )
    parser.add_argument("--load-map", metavar="FILE", help="continue in the map of an earlier run: its map.tessera")
    parser.add_argument("--save-map", metavar="FILE", help="one more copy of the run's map.tessera")
    parser.add_argument(
        "--localize-only",
        action="store_true",
        help="find the camera in the map of --load-map, and leave the map unchanged",
    )
