"""tessera deploy: Tessera on other nodes."""

from argparse import Namespace

from tessera_cli.cli.parsing import Commands, add_command

EPILOG = """\
NODE is [USER@]HOST or [USER@]HOST:FOLDER; the default folder is `tessera` in the home folder. Copies what git
tracks.
Exit status: 0 all nodes are ready, 1 one is not, 2 the arguments are wrong.

examples:
  procman/tessera deploy pi@board1 pi@board2 --setup
  procman/tessera deploy node2:/opt/tessera --built --dry-run
"""


def add_parser(commands: Commands) -> None:
    summary = "Copies the sources to nodes by ssh and rsync, and reports what each of them lacks."
    parser = add_command(commands, "deploy", main, summary, EPILOG)
    parser.add_argument("nodes", metavar="NODE", nargs="+", help="see below")
    parser.add_argument(
        "--built",
        action="store_true",
        help="copy the programs of this machine too, for nodes of its CPU type and system",
    )
    parser.add_argument(
        "--setup", action="store_true", help="then run `procman/tessera setup` there, which asks before it uses sudo"
    )
    parser.add_argument("--dry-run", action="store_true", help="look, and change nothing")
    parser.add_argument("--ssh", metavar="COMMAND", default="ssh", help="default ssh; such as 'ssh -p 2222 -i KEY'")


def main(arguments: Namespace) -> int:
    from tessera_cli.cluster.deploy import deploy

    return deploy(arguments)
