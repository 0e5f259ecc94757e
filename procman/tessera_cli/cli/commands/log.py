"""tessera log: the output of a process on any node."""

from argparse import Namespace

from tessera_cli.cli.options import add_lan
from tessera_cli.cli.parsing import Commands, add_command, whole_number


def add_parser(commands: Commands) -> None:
    summary = "The last lines that a process wrote, from its node."
    parser = add_command(commands, "log", main, summary, "examples:\n  procman/tessera log tracker --follow\n")
    parser.add_argument("name", metavar="[LIST/]NAME", help="of the process, as `tessera status` shows it")
    parser.add_argument("--lines", type=whole_number(1, 10000), metavar="N", default=50, help="default 50")
    parser.add_argument("--follow", action="store_true", help="also what it writes from now on, until Ctrl-C")
    add_lan(parser)


def main(arguments: Namespace) -> int:
    from tessera_cli.supervision.sheriff_commands import log

    return log(arguments)
