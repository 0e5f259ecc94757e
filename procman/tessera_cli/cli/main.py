"""The entry: parses the arguments and runs the command. Exit status 0 done, 1 it failed, 2 the input is wrong."""

import os
import resource
import sys
from argparse import Namespace
from io import TextIOWrapper

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
from tessera_cli.files import NO_ROOM
from tessera_cli.text import visible
from tessera_cli.versions import tessera_version

# Of one process: two for each child, and some for buses, logs and libraries.
MIN_OPEN_FILES, WANTED_OPEN_FILES = 128, 1024

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
    return parser.parse_args(log.join_tool(arguments))


def main() -> int:
    """Returns the exit status. What the system refuses becomes a sentence; only an error of this program is traced."""
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # PYTHONIOENCODING may not have the letters of a path
    try:
        _require_open_files()
        try:
            arguments = parse_arguments(sys.argv[1:])
            return arguments.main(arguments)
        finally:
            sys.stdout.flush()
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
        _drop_output()  # its reader, such as `head`, has closed it
        return 1
    except OSError as error:
        if error.filename is None and error.errno in NO_ROOM:
            _drop_output()
            place = "the output of this command can't be written"
        else:
            place = str(error.filename or "the system refused something")
        print(f"tessera: {visible(place)}: {error.strerror or error}.", file=sys.stderr)
        return 1


def _drop_output() -> None:
    """What can't be written: Python would complain once more at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _require_open_files() -> None:
    """Raises the limit as far as this user may. Raises RunError if it is too low even for one process of a run."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = WANTED_OPEN_FILES if hard == resource.RLIM_INFINITY else min(hard, WANTED_OPEN_FILES)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        soft = wanted
    if soft != resource.RLIM_INFINITY and soft < MIN_OPEN_FILES:
        raise RunError(
            f"this shell lets a program open {soft} files at a time, and Tessera needs {MIN_OPEN_FILES}; "
            f"in another shell: ulimit -n {WANTED_OPEN_FILES}"
        )
