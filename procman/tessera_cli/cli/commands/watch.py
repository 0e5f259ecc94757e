"""tessera watch: what runs where, redrawn continuously."""

from argparse import Namespace

from tessera_cli.cli.options import add_lan
from tessera_cli.cli.parsing import Commands, add_command


def add_parser(commands: Commands) -> None:
    summary = "Nodes, processes, frame rates and output, redrawn until Ctrl-C."
    add_lan(add_command(commands, "watch", main, summary, "examples:\n  procman/tessera watch\n"))


def main(arguments: Namespace) -> int:
    from tessera_cli.supervision.watch import watch

    return watch(arguments)
