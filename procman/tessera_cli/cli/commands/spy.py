"""tessera spy: what is on a bus, in lcm-spy's window or as text."""

from argparse import Namespace

from tessera_cli.cli.options import add_lan
from tessera_cli.cli.parsing import Commands, add_command, whole_number
from tessera_cli.constants import PORT_OFFSETS
from tessera_cli.errors import UserError

EPILOG = """\
The text is a table of rates, sizes and gaps (messages whose numbers are missing in their stream; those that are
repaired come later), and the last message of one channel as a tree; arrows select another one, q ends. Without a
terminal it is printed as lines: every few seconds or, with --seconds, once at the end.

examples:
  procman/tessera spy --bus camera
  procman/tessera spy --text
  procman/tessera spy --text --channel POSE --seconds 5 > pose.txt
"""


def add_parser(commands: Commands) -> None:
    parser = add_command(commands, "spy", main, "What is on a bus: lcm-spy with Tessera's types, or text.", EPILOG)
    parser.add_argument("--bus", choices=tuple(PORT_OFFSETS), default="main", help="default main")
    parser.add_argument("--text", action="store_true", help="in this terminal, not in a window")
    parser.add_argument("--channel", metavar="NAME", help="with --text: show the last message of this channel")
    parser.add_argument(
        "--seconds", type=whole_number(1, 86400), metavar="N", help="with --text: end by itself after so long"
    )
    add_lan(parser)


def main(arguments: Namespace) -> int:
    if arguments.text:
        from tessera_cli.spy.text_spy import spy_as_text

        return spy_as_text(arguments)
    if arguments.channel or arguments.seconds:
        raise UserError("--channel and --seconds go with --text.")
    from tessera_cli.spy.window_spy import open_window

    return open_window(arguments)
