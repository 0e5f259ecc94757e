"""tessera down: ends process lists."""

from argparse import Namespace

from tessera_cli.cli.options import add_lan, add_timeout
from tessera_cli.cli.parsing import Commands, add_command


def add_parser(commands: Commands) -> None:
    summary = "Stops all processes of one list, or of all lists."
    examples = "examples:\n  procman/tessera down\n  procman/tessera down robot_a\n"
    parser = add_command(commands, "down", main, summary, examples)
    parser.add_argument(
        "name", metavar="NAME", nargs="?", default="", help="of the list, as `tessera status` shows it; default: all"
    )
    add_lan(parser)
    add_timeout(parser, 60)


def main(arguments: Namespace) -> int:
    from tessera_cli.supervision.sheriff_commands import down

    return down(arguments)
