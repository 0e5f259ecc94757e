"""tessera replay: the whole stack on this machine, fed by a recorded log."""

from argparse import Namespace
from pathlib import Path

from tessera_cli.cli.commands import run
from tessera_cli.cli.options import add_run_options
from tessera_cli.cli.parsing import Commands, add_command
from tessera_cli.console import say
from tessera_cli.constants import LOADED_MAP


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "replay",
        main,
        "The whole stack, fed by a recorded LCM log.",
        "examples:\n  procman/tessera replay logs/drive.lcmlog --extractors 2\n"
        "  procman/tessera replay logs/drive/run.lcmlog --only tracker\n",
    )
    parser.add_argument("log", metavar="LOG")
    parser.add_argument(
        "--only",
        metavar="STAGE",
        help="only this stage of a run that was recorded (run --record) gets what it got then; the first message in "
        "which it says something else is named",
    )
    add_run_options(parser)


def main(arguments: Namespace) -> int:
    if arguments.only:
        from tessera_cli.runs.stage_replay import replay_stage

        return replay_stage(arguments)
    arguments.source = f"log:{arguments.log}"
    begun_with = Path(arguments.log).parent / LOADED_MAP
    if not arguments.map and not arguments.load_map and begun_with.is_file():
        say(f"the recorded run began with {begun_with}, and so does this one (--load-map names another map)")
        arguments.load_map = str(begun_with)
    return run.main(arguments)
