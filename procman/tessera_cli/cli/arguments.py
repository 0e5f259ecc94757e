"""What people type. Uses the standard library alone, so that --help works before anything is installed."""

import argparse
import os
import re
from pathlib import Path

SOURCES = """\
SOURCE is one of
  kitti:DIR    a sequence folder of the KITTI odometry benchmark
  euroc:DIR    holds mav0/
  tum:DIR      TUM RGB-D: rgb.txt, depth.txt, groundtruth.txt
  video:FILE   any video file that OpenCV reads; needs --camera, or FILE.yaml beside it
  camera:N     V4L2 device /dev/videoN; needs --camera
  rtsp://...   network stream; needs --camera
  sim:NAME     a made world with exact truth: street, street-short or room; options behind it: sim:street,seed=3,length=500
               (also speed=, noise=, scale= times the usual, duration= of the room in s, path=FILE of KITTI poses)
  log:FILE     a log recorded by `tessera record`, `tessera run --record` or lcm-logger
  bus:[URL]    frames that another program, such as lcm-logplayer, publishes; default: this stack's main bus
"""

RUN_EXAMPLES = """
examples:
  procman/tessera run kitti:data/kitti/sequences/03 --extractors 2 --tiles 2x2
  procman/tessera run euroc:data/MH_01 --sensor stereo --out logs/mh01
  procman/tessera run video:drive.mp4 --camera my_camera.yaml --frames 100:600
  procman/tessera run bus: & .venv/bin/lcm-logplayer drive.lcmlog
"""


COMMANDS = str(Path(__file__).resolve().parents[2] / "commands.pmd")
# Of sim:street-short: once around the block and some 40 m of it again.
DEMO_FRAMES = 593
# The extractors' own limit (features/feature_types.cc), told before anything starts.
MAX_FEATURES = 50000


class Parser(argparse.ArgumentParser):
    """Says what is wrong in one sentence instead of printing the whole usage."""

    def error(self, message: str) -> None:
        self.exit(2, f"tessera: {message.removeprefix('argument ')}; {self.prog} --help explains the arguments.\n")


def whole_number(minimum: int, maximum: int):
    def parse(text: str) -> int:
        if not re.fullmatch(r"-?\d{1,9}", text) or not minimum <= int(text) <= maximum:
            raise argparse.ArgumentTypeError(f"must be a whole number from {minimum} to {maximum}, not '{text}'")
        return int(text)

    return parse


def tiles(text: str) -> str:
    if not re.fullmatch(r"0*[1-9]\d{0,2}x0*[1-9]\d{0,2}", text):
        raise argparse.ArgumentTypeError(f"must be LINESxCOLUMNS, both at least 1, such as 2x4, not '{text}'")
    return "x".join(str(int(part)) for part in text.split("x"))


def pace(text: str) -> str:
    if text in ("lockstep", "realtime"):
        return text
    if re.fullmatch(r"\d+(\.\d+)?|\.\d+", text) and float(text) > 0:
        return str(float(text))
    raise argparse.ArgumentTypeError(f"must be lockstep, realtime or a speed factor such as 0.5, not '{text}'")


def frames(text: str) -> tuple[int, int]:
    """`A:B` as (first, last), `last` exclusive and -1 where it is left out."""
    match = re.fullmatch(r"(\d{0,9}):(\d{0,9})", text)
    if not match:
        raise argparse.ArgumentTypeError(f"must be A:B, the first frame and the one behind the last, not '{text}'")
    first, last = int(match[1] or 0), int(match[2]) if match[2] else -1
    if last != -1 and last <= first:
        raise argparse.ArgumentTypeError(f"holds no frame: '{text}' must have A < B")
    return first, last


def cmd_count(text: str) -> tuple[str, int]:
    name, equals, number = text.partition("=")
    if not name or not equals or not re.fullmatch(r"\d{1,3}", number):
        raise argparse.ArgumentTypeError(f"'{text}' is not CMD=NUMBER, such as extractor=4")
    return name, int(number)


def assignment(text: str) -> str:
    if not re.fullmatch(r"[^=]+=.*", text, re.DOTALL):
        raise argparse.ArgumentTypeError(f"must be section.key=value, not '{text}'")
    return text


def add_source_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--sensor", choices=("mono", "stereo", "rgbd"), default="mono", help="default mono")
    parser.add_argument(
        "--camera", metavar="FILE.yaml", help="calibration, where the source brings none, or instead of its own"
    )
    parser.add_argument("--frames", type=frames, metavar="A:B", default=(0, -1), help="only frames A..B-1")
    parser.add_argument(
        "--set",
        dest="settings",
        type=assignment,
        metavar="section.key=value",
        action="append",
        default=[],
        help="any setting of config/default.yaml; may be repeated",
    )


def add_run_options(parser: argparse.ArgumentParser) -> None:
    add_source_options(parser)
    parser.add_argument(
        "--extractors",
        type=whole_number(0, 256),
        metavar="P",
        default=os.cpu_count() or 1,
        help="extractor processes, default: cores of this machine; 0: those of a pool that runs (procman/pool.pmd)",
    )
    parser.add_argument(
        "--prefix",
        metavar="TEXT",
        default="",
        help="before every channel's name, for several robots on one bus, such as a_",
    )
    parser.add_argument(
        "--tiles",
        type=tiles,
        metavar="LxC",
        default="1x1",
        help="lines x columns that an image is cut into, default 1x1",
    )
    parser.add_argument(
        "--features", type=whole_number(1, MAX_FEATURES), metavar="N", help="keypoints per image, default 2000"
    )
    parser.add_argument(
        "--pace",
        type=pace,
        metavar="lockstep|realtime|X",
        help="default lockstep for files, realtime for cameras; X is a speed factor",
    )
    parser.add_argument("--out", metavar="DIR", help="the run's folder, default logs/<date-time>-<source name>")
    parser.add_argument(
        "--live",
        action="store_true",
        help="the tracker never waits for the mapper; a recording of such a run is replayed just as it went",
    )
    parser.add_argument(
        "--no-loop-closing", action="store_true", help="the map is never bent to make a place seen twice one"
    )
    parser.add_argument("--load-map", metavar="FILE", help="go on in the map of an earlier run: its map.tessera")
    parser.add_argument("--save-map", metavar="FILE", help="one more copy of the run's map.tessera")
    parser.add_argument(
        "--localize-only",
        action="store_true",
        help="find the camera in the map of --load-map, and leave the map as it is",
    )
    parser.add_argument("--record", action="store_true", help="all channels into DIR/run.lcmlog")
    add_port(parser)


def add_port(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--port",
        type=whole_number(1024, 65000),
        metavar="N",
        default=7667,
        help="base port of the buses, for a second stack on one machine; default 7667",
    )


def add_command(commands, name: str, module: str, summary: str, epilog: str = "") -> argparse.ArgumentParser:
    parser = commands.add_parser(
        name,
        help=summary,
        description=summary,
        epilog=epilog,
        allow_abbrev=False,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(module=module)
    return parser


def add_run_commands(commands) -> None:
    run = add_command(
        commands,
        "run",
        "runs.launcher",
        "The whole stack on this machine, until the source ends or Ctrl-C.",
        SOURCES + RUN_EXAMPLES,
    )
    run.add_argument("source", metavar="SOURCE", help="see below")
    run.set_defaults(source_prefix="")
    add_run_options(run)
    replay = add_command(
        commands,
        "replay",
        "runs.launcher",
        "The whole stack, fed by a recorded LCM log.",
        "examples:\n  procman/tessera replay logs/drive.lcmlog --extractors 2\n",
    )
    replay.add_argument("source", metavar="LOG")
    replay.set_defaults(source_prefix="log:")
    add_run_options(replay)
    record = add_command(
        commands,
        "record",
        "runs.recording",
        "Writes a source into an LCM log that stock lcm-logplayer can play.",
        SOURCES + "\nexamples:\n  procman/tessera record kitti:data/kitti/sequences/03 logs/03.lcmlog\n",
    )
    record.add_argument("source", metavar="SOURCE", help="see below")
    record.add_argument("log", metavar="LOG", help="the file to write")
    add_source_options(record)


def add_demo(commands) -> None:
    demo = add_command(
        commands,
        "demo",
        "runs.demo",
        "Shows that it works: a drive through a made town, the whole stack, and the result.",
        "The drive is rendered into logs/ once and used again.\n\nexamples:\n"
        "  procman/tessera demo\n  procman/tessera demo --frames 150\n",
    )
    demo.add_argument(
        "--frames",
        type=whole_number(30, DEMO_FRAMES),
        metavar="N",
        default=DEMO_FRAMES,
        help=f"only the first N frames of the drive, default all {DEMO_FRAMES}; the loop is closed by the last ones",
    )
    demo.add_argument(
        "--logs", metavar="DIR", help="where the rendered drive is kept and the run's folder is made, default logs/"
    )
    demo.add_argument("--out", metavar="DIR", help="the run's folder, default logs/<date-time>-demo")
    add_port(demo)


def add_look_commands(commands) -> None:
    evaluate = add_command(
        commands,
        "evaluate",
        "report.evaluate",
        "Error of runs or trajectory files against ground truth, by the evo package.",
        "Files hold TUM rows `timestamp tx ty tz qx qy qz qw` or KITTI rows of 12 numbers.\n\nexamples:\n"
        "  procman/tessera evaluate logs/mh01\n"
        "  procman/tessera evaluate trajectory_kitti.txt data/kitti/poses/03.txt --align sim3 --report both.html\n"
        "  procman/tessera evaluate logs/one logs/another --report beside.html\n",
    )
    evaluate.usage = "procman/tessera evaluate RUN|TRAJECTORY ... [GROUND_TRUTH] [options]"
    evaluate.add_argument(
        "paths",
        metavar="RUN|TRAJECTORY ... [GROUND_TRUTH]",
        nargs="+",
        help="runs' folders or trajectory files, one or several; a file behind them is the truth of them all, "
        "by default each run's own ground_truth.txt",
    )
    evaluate.add_argument(
        "--report", metavar="FILE.html", help="a report for people too, with all of them beside each other"
    )
    evaluate.add_argument(
        "--align", choices=("sim3", "se3"), help="default: se3 for a stereo or RGB-D run, sim3 (with scale) otherwise"
    )
    keep_map = add_command(
        commands,
        "map",
        "runs.map_export",
        "Joins a running stack and writes its map as a cloud of points (PLY).",
        "Any viewer of point clouds opens the file: MeshLab, CloudCompare, Blender.\n\nexamples:\n"
        "  procman/tessera map /tmp/now.ply\n  procman/tessera map /tmp/whole.ply --follow\n"
        "  procman/tessera map /tmp/robot_b.ply --prefix B_ --lan\n",
    )
    keep_map.add_argument("path", metavar="OUT.ply", help="the file to write")
    keep_map.add_argument("--follow", action="store_true", help="write when the run has ended, not at once")
    keep_map.add_argument(
        "--prefix", metavar="TEXT", default="", help="the stack's bus.channel_prefix, where it has one"
    )
    add_lan_options(keep_map)
    experiment = add_command(
        commands,
        "experiment",
        "report.experiment_extraction",
        "Measurements, as a table, a CSV file and a plot under logs/.",
        "examples:\n  procman/tessera experiment extraction\n  procman/tessera experiment places sim:street,seed=9\n",
    )
    experiment.add_argument(
        "name",
        metavar="NAME",
        choices=("extraction", "places", "worlds"),
        help="extraction: time per image against cv::ORB; places: recall and precision of place recognition; "
        "worlds: how hard made and recorded sequences are",
    )
    experiment.add_argument(
        "sources", metavar="SOURCE", nargs="*", help="places, worlds: with ground truth, instead of those it has itself"
    )
    spy = add_command(
        commands,
        "spy",
        "cli.spy",
        "lcm-spy with Tessera's message types.",
        "examples:\n  procman/tessera spy --bus camera\n",
    )
    spy.add_argument("--bus", choices=("main", "camera", "work", "procman"), default="main", help="default main")
    add_port(spy)


def add_vocabulary_command(commands) -> None:
    vocabulary = add_command(
        commands,
        "vocabulary",
        "cli.vocabulary",
        "Vocabularies of binary words, for the recognition of places.",
        "examples:\n  procman/tessera vocabulary train mine.tvoc photos/ kitti:data/kitti/sequences/03\n"
        "  procman/tessera vocabulary info config/vocabulary.tvoc\n",
    )
    actions = vocabulary.add_subparsers(metavar="train|info", required=True, dest="action", parser_class=Parser)
    train = actions.add_parser(
        "train",
        help="learns one from images",
        allow_abbrev=False,
        epilog=SOURCES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    train.add_argument("out", metavar="OUT", help="the file to write")
    train.add_argument(
        "sources", metavar="SOURCE", nargs="+", help="a source that ends, see below, or a folder of photos"
    )
    train.add_argument(
        "--every", type=whole_number(1, 100000), metavar="N", help="one frame in N of a source, default 10"
    )
    train.add_argument(
        "--views", type=whole_number(1, 1000), metavar="N", help="views cut out of each photo, default 4"
    )
    train.add_argument("--camera", metavar="FILE.yaml", help="calibration, where a source brings none")
    train.add_argument(
        "--features", type=whole_number(1, MAX_FEATURES), metavar="N", help="keypoints per image, default 2000"
    )
    train.add_argument(
        "--children", type=whole_number(2, 255), metavar="K", help="into which a node is split, default 10"
    )
    train.add_argument(
        "--levels", type=whole_number(1, 10), metavar="L", help="of the tree, default 5: at most K^L words"
    )
    train.add_argument(
        "--seed", type=whole_number(0, 999999999), metavar="N", help="another seed, another vocabulary; default 1"
    )
    info = actions.add_parser("info", help="checks one and tells what is in it", allow_abbrev=False)
    info.add_argument("path", metavar="FILE")


def add_keys_command(commands) -> None:
    keys = add_command(
        commands,
        "keys",
        "cluster.keys",
        "Whose orders the deputies of this user obey; lists them.",
        "examples:\n  procman/tessera keys\n  procman/tessera keys trust base 3q2+7w...=\n",
    )
    actions = keys.add_subparsers(metavar="list|make|trust|revoke", dest="action", parser_class=Parser)
    actions.add_parser("list", help="this user's public key and all that are trusted; the default", allow_abbrev=False)
    actions.add_parser("make", help="a new key instead of this user's own", allow_abbrev=False)
    trust = actions.add_parser("trust", help="obey another's orders", allow_abbrev=False)
    trust.add_argument("name", metavar="NAME", help="a name for it")
    trust.add_argument("key", metavar="KEY", help="what `tessera keys` shows there")
    revoke = actions.add_parser("revoke", help="obey them no longer", allow_abbrev=False)
    revoke.add_argument("name", metavar="NAME")


def add_deploy_command(commands) -> None:
    deploy = add_command(
        commands,
        "deploy",
        "cluster.deploy",
        "Copies the sources to nodes by ssh and rsync, and tells what each of them lacks.",
        "NODE is [USER@]HOST or [USER@]HOST:FOLDER; the folder is `tessera` in the home folder where it is left out. Copied is what git tracks.\n"
        "Exit status: 0 all nodes are ready, 1 one is not, 2 the arguments are at fault.\n\nexamples:\n"
        "  procman/tessera deploy pi@board1 pi@board2 --setup\n  procman/tessera deploy node2:/opt/tessera --built --dry-run\n",
    )
    deploy.add_argument("nodes", metavar="NODE", nargs="+", help="see below")
    deploy.add_argument(
        "--built", action="store_true", help="the programs of this machine too, for nodes of its CPU type and system"
    )
    deploy.add_argument(
        "--setup", action="store_true", help="then run `procman/tessera setup` there, which asks before it uses sudo"
    )
    deploy.add_argument("--dry-run", action="store_true", help="look, and change nothing")
    deploy.add_argument("--ssh", metavar="COMMAND", default="ssh", help="default ssh; such as 'ssh -p 2222 -i KEY'")


def add_lan_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--lan",
        action="store_true",
        help="speak to the network (ttl 1), not to this machine alone; TESSERA_LAN=1 in the environment does the same",
    )
    add_port(parser)


def add_timeout(parser: argparse.ArgumentParser, seconds: int) -> None:
    parser.add_argument(
        "--timeout",
        type=whole_number(1, 86400),
        metavar="S",
        default=seconds,
        help=f"seconds to wait, default {seconds}",
    )


def add_lan_command(commands, name: str, module: str, summary: str, epilog: str) -> argparse.ArgumentParser:
    parser = add_command(commands, name, module, summary, epilog)
    parser.set_defaults(command=name)
    add_lan_options(parser)
    return parser


def add_deputy_command(commands) -> None:
    deputy = add_lan_command(
        commands,
        "deputy",
        "supervision.deputy",
        "Runs on each node: starts, watches and ends processes that signed orders name.",
        "It goes on with its last order when it is started again. Ctrl-C or SIGTERM ends it and all its processes.\n\nexamples:\n"
        "  procman/tessera deputy\n  procman/tessera deputy --id node2 --lan\n",
    )
    deputy.add_argument("--id", metavar="NAME", help="default: the name of this machine")
    deputy.add_argument(
        "--commands",
        metavar="FILE",
        default=COMMANDS,
        help="what it may execute, by name; default procman/commands.pmd",
    )
    deputy.add_argument("--folder", metavar="DIR", help="its logs and last order, default logs/deputies/<id>-<port>")
    deputy.add_argument("--fresh", action="store_true", help="don't go on with the last order")


def add_sheriff_commands(commands) -> None:
    up = add_lan_command(
        commands,
        "up",
        "runs.up",
        "Starts the processes of a list on their nodes and waits until all are ready.",
        "Exit status: 0 all are ready (or the script ended well), 1 one can't or not in time, 2 the list or the arguments are at fault.\n\n"
        "examples:\n  procman/tessera up procman/local.pmd --set camera.source=kitti:DIR --out /tmp/run\n"
        "  procman/tessera up procman/lan.pmd --lan --script run --set camera.source=kitti:DIR --out /tmp/run\n"
        "  procman/tessera up procman/local.pmd --name robot_a --set bus.channel_prefix=A_ --set camera.source=kitti:DIR\n",
    )
    up.add_argument("file", metavar="FILE", help="a process list, such as procman/lan.pmd")
    up.add_argument(
        "--name",
        metavar="NAME",
        default="",
        help="of the list; a second `up` of one name replaces the first; default: its file's",
    )
    up.add_argument("--script", metavar="NAME", help="carry out this script of the list instead")
    up.add_argument(
        "--count",
        dest="counts",
        type=cmd_count,
        metavar="CMD=N",
        action="append",
        default=[],
        help="as many of this cmd on each of its hosts, instead of what the list says; may be repeated",
    )
    up.add_argument("--out", metavar="DIR", help="the run's folder, on the node of the evaluator")
    up.add_argument(
        "--set",
        dest="settings",
        type=assignment,
        metavar="section.key=value",
        action="append",
        default=[],
        help="any setting of config/default.yaml; may be repeated",
    )
    add_timeout(up, 60)
    down = add_lan_command(
        commands,
        "down",
        "supervision.sheriff_commands",
        "Stops all processes of one list, or of all lists.",
        "examples:\n  procman/tessera down\n  procman/tessera down robot_a\n",
    )
    down.add_argument(
        "name", metavar="NAME", nargs="?", default="", help="of the list, as `tessera status` shows it; default: all"
    )
    add_timeout(down, 60)
    status = add_lan_command(
        commands,
        "status",
        "supervision.sheriff_commands",
        "Nodes and processes, once; exit status 1 if one failed.",
        "examples:\n  procman/tessera status --json\n",
    )
    status.add_argument("--json", action="store_true", help="for programs")
    add_lan_command(
        commands,
        "watch",
        "supervision.watch",
        "Nodes, processes, frame rates and output, drawn anew until Ctrl-C.",
        "examples:\n  procman/tessera watch\n",
    )
    restart = add_lan_command(
        commands,
        "restart",
        "supervision.sheriff_commands",
        "Ends a process and starts it again; waits until it is ready.",
        "examples:\n  procman/tessera restart mapper\n",
    )
    restart.add_argument("name", metavar="[LIST/]NAME", help="of the process, as `tessera status` shows it")
    add_timeout(restart, 60)
    log = add_lan_command(
        commands,
        "log",
        "supervision.sheriff_commands",
        "The last lines that a process wrote, from its node.",
        "examples:\n  procman/tessera log tracker --follow\n",
    )
    log.add_argument("name", metavar="[LIST/]NAME", help="of the process, as `tessera status` shows it")
    log.add_argument("--lines", type=whole_number(1, 10000), metavar="N", default=50, help="default 50")
    log.add_argument("--follow", action="store_true", help="and what it writes from now on, until Ctrl-C")


def parse_arguments(arguments: list[str]) -> argparse.Namespace:
    parser = Parser(prog="procman/tessera", description="A distributed visual SLAM stack over LCM.", allow_abbrev=False)
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    add_demo(commands)
    add_run_commands(commands)
    add_look_commands(commands)
    add_vocabulary_command(commands)
    add_deputy_command(commands)
    add_sheriff_commands(commands)
    add_keys_command(commands)
    add_deploy_command(commands)
    return parser.parse_args(arguments)
