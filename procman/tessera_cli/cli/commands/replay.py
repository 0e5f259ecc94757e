"""tessera replay: the whole stack on this machine, fed by a recorded log."""

from argparse import Namespace

from tessera_cli.cli.commands import run
from tessera_cli.cli.options import add_run_options
from tessera_cli.cli.parsing import Commands, add_command


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "replay",
        main,
        "The whole stack, fed by a recorded LCM log.",
        "examples:\n  procman/tessera replay logs/drive.lcmlog --extractors 2\n",
    )
    parser.add_argument("log", metavar="LOG")
    add_run_options(parser)


def main(arguments: Namespace) -> int:
    arguments.source = f"log:{arguments.log}"
    return run.main(arguments)
