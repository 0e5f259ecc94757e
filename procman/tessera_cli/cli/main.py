"""The entry: parses the arguments and runs the command. Exit status 0 done, 1 it failed, 2 the input is wrong."""

import os
import sys
from argparse import Namespace

from tessera_cli.cli.commands import (
    demo,
    deploy,
    deputy,
    down,
    evaluate,
    experiment,
    export,
    keys,
    log,
    map,
    record,
    replay,
    restart,
    run,
    spy,
    status,
    up,
    view,
    vocabulary,
    watch,
)
from tessera_cli.cli.parsing import Parser
from tessera_cli.errors import RunError, UserError
from tessera_cli.versions import tessera_version

# In the order of --help.
COMMANDS = (
    *(demo, run, replay, record, evaluate, map, view, export, experiment, vocabulary, spy),
    *(deputy, up, down, status, watch, restart, log, deploy, keys),
)


def parse_arguments(arguments: list[str]) -> Namespace:
    """`main` of the result is the command's function. Ends the process with status 2 if they are wrong."""
    parser = Parser(prog="procman/tessera", description="A distributed visual SLAM stack over LCM.", allow_abbrev=False)
    parser.add_argument("--version", action="version", version=f"tessera {tessera_version()}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    for command in COMMANDS:
        command.add_parser(commands)
    return parser.parse_args(arguments)


def main() -> int:
    """Returns the exit status."""
    arguments = parse_arguments(sys.argv[1:])
    try:
        return arguments.main(arguments)
    except UserError as error:
        print(f"tessera: {error}", file=sys.stderr)
        return 2
    except RunError as error:
        print(f"tessera: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("tessera: interrupted.", file=sys.stderr)
        return 1
    except BrokenPipeError:
        # The reader of our output, such as `head`, has closed it; Python would complain once more at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
