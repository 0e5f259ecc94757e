"""tessera status: what runs where."""

from argparse import Namespace

from tessera_cli.cli.options import add_lan
from tessera_cli.cli.parsing import Commands, add_command


def add_parser(commands: Commands) -> None:
    summary = "Nodes and processes, once; exit status 1 if one has failed."
    parser = add_command(commands, "status", main, summary, "examples:\n  procman/tessera status --json\n")
    parser.add_argument("--json", action="store_true", help="for programs")
    add_lan(parser)


def main(arguments: Namespace) -> int:
    from tessera_cli.supervision.sheriff_commands import status

    return status(arguments)
