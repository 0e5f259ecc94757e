"""tessera up: a process list on its nodes."""

from argparse import Namespace

from tessera_cli.cli.commands.run import present
from tessera_cli.cli.options import add_lan, add_settings, add_timeout
from tessera_cli.cli.parsing import Commands, add_command, command_count

EPILOG = """\
Exit status: 0 all are ready (or the script ended well), 1 one failed or was not ready in time, 2 the list or the
arguments are wrong.

examples:
  procman/tessera up procman/local.pmd --set camera.source=kitti:DIR --out /tmp/run
  procman/tessera up procman/lan.pmd --lan --script run --set camera.source=kitti:DIR --out /tmp/run
  procman/tessera up procman/local.pmd --name robot_a --set bus.channel_prefix=A_ --set camera.source=kitti:DIR
"""


def add_parser(commands: Commands) -> None:
    summary = "Starts the processes of a list on their nodes and waits until all are ready."
    parser = add_command(commands, "up", main, summary, EPILOG)
    parser.add_argument("file", metavar="FILE", help="a process list, such as procman/lan.pmd")
    parser.add_argument(
        "--name",
        metavar="NAME",
        default="",
        help="of the list; a second `up` of one name replaces the first; default: its file's",
    )
    parser.add_argument("--script", metavar="NAME", help="carry out this script of the list instead")
    parser.add_argument(
        "--count",
        dest="counts",
        type=command_count,
        metavar="CMD=N",
        action="append",
        default=[],
        help="number of processes of this cmd on each of its hosts, instead of the list's; may be repeated",
    )
    parser.add_argument("--out", metavar="DIR", help="the run's folder, on the node of the evaluator")
    add_settings(parser)
    add_lan(parser)
    add_timeout(parser, 60)


def main(arguments: Namespace) -> int:
    from tessera_cli.runs.up import up

    return up(arguments, present)
