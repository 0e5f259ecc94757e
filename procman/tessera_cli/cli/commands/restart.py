"""tessera restart: ends one process and starts it again."""

from argparse import Namespace

from tessera_cli.cli.options import add_lan, add_timeout
from tessera_cli.cli.parsing import Commands, add_command


def add_parser(commands: Commands) -> None:
    summary = "Ends a process and starts it again; waits until it is ready."
    parser = add_command(commands, "restart", main, summary, "examples:\n  procman/tessera restart mapper\n")
    parser.add_argument("name", metavar="[LIST/]NAME", help="of the process, as `tessera status` shows it")
    add_lan(parser)
    add_timeout(parser, 60)


def main(arguments: Namespace) -> int:
    from tessera_cli.supervision.sheriff_commands import restart

    return restart(arguments)
