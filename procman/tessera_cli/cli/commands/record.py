"""tessera record: a source into a log."""

from argparse import Namespace

from tessera_cli.cli.options import SOURCES, add_force, add_source_options
from tessera_cli.cli.parsing import Commands, add_command


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "record",
        main,
        "Writes a source into an LCM log that stock lcm-logplayer can play.",
        SOURCES + "\nexamples:\n  procman/tessera record kitti:data/kitti/sequences/03 logs/03.lcmlog\n",
    )
    parser.add_argument("source", metavar="SOURCE", help="see below")
    parser.add_argument("log", metavar="LOG", help="the file to write")
    add_force(parser, "LOG may be replaced")
    add_source_options(parser)


def main(arguments: Namespace) -> int:
    from tessera_cli.runs.recording import record_source

    return record_source(arguments)
