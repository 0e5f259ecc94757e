"""tessera deputy: the process that runs on each node of a LAN."""

from argparse import Namespace

from tessera_cli.cli.options import add_lan
from tessera_cli.cli.parsing import Commands, add_command
from tessera_cli.files import PROCMAN

EPILOG = """\
It resumes its last orders when it is restarted. Ctrl-C or SIGTERM ends it and all its processes.

examples:
  procman/tessera deputy
  procman/tessera deputy --id node2 --lan
"""


def add_parser(commands: Commands) -> None:
    summary = "Runs on each node: starts, watches and ends processes that signed orders name."
    parser = add_command(commands, "deputy", main, summary, EPILOG)
    parser.add_argument("--id", metavar="NAME", help="default: the name of this machine")
    parser.add_argument(
        "--commands",
        metavar="FILE",
        default=str(PROCMAN / "commands.pmd"),
        help="what it may execute, by name; default procman/commands.pmd",
    )
    parser.add_argument("--folder", metavar="DIR", help="its logs and last orders, default logs/deputies/<id>-<port>")
    parser.add_argument("--fresh", action="store_true", help="don't resume the last orders")
    add_lan(parser)


def main(arguments: Namespace) -> int:
    from tessera_cli.supervision.deputy import run_deputy

    return run_deputy(arguments)
