"""tessera log: the output of a process on any node; or, by the name of a tool, what is in a recorded log."""

from argparse import Namespace

from tessera_cli.cli.options import add_lan
from tessera_cli.cli.parsing import Commands, Main, Parser, add_command, second_of, whole_number

# `tessera log TOOL LOG ...`; other words are names of processes.
TOOLS = ("info", "gaps", "cut", "filter", "export")
EPILOG = """\
log info|gaps|cut|filter|export LOG: what is in a recorded LCM log (record, run --record, lcm-logger), and parts of it.

examples:
  procman/tessera log tracker --follow
  procman/tessera log info drive.lcmlog
  procman/tessera log cut drive.lcmlog part.lcmlog --from 10 --to 25
  procman/tessera log filter drive.lcmlog camera.lcmlog CAMERA CALIBRATION GROUND_TRUTH END_OF_STREAM
  procman/tessera log export drive.lcmlog tables/ POSE STATUS
"""


def add_parser(commands: Commands) -> None:
    parser = add_command(commands, "log", main, "The last lines that a process wrote, from its node.", EPILOG)
    parser.add_argument("name", metavar="[LIST/]NAME", help="of the process, as `tessera status` shows it")
    parser.add_argument("--lines", type=whole_number(1, 10000), metavar="N", default=50, help="default 50")
    parser.add_argument("--follow", action="store_true", help="also what it writes from now on, until Ctrl-C")
    add_lan(parser)
    _add_tool(commands, "info", info, "The channels of a log: messages, rates, sizes, types, publishers.")
    _add_tool(
        commands, "gaps", gaps, "Messages that a log lacks, by channel and publisher; exit status 1 if there are some."
    )
    tool = _add_tool(commands, "cut", cut, "The part of a log between two times, as a log.", "out")
    tool.add_argument("--from", dest="first", type=second_of, metavar="S", default=0.0, help="since its first message")
    tool.add_argument("--to", dest="last", type=second_of, metavar="S", help="default: its end")
    tool = _add_tool(commands, "filter", filter_channels, "Some channels of a log, as a log.", "out")
    tool.add_argument("channels", metavar="CHANNEL", nargs="+", help="patterns are possible: 'TILE_*'")
    tool.add_argument("--without", action="store_true", help="all channels but these")
    tool = _add_tool(
        commands, "export", export, "The messages of a log as JSON lines, a file for each channel.", "folder"
    )
    tool.add_argument("channels", metavar="CHANNEL", nargs="*", help="only these; patterns are possible: 'TILE_*'")


def _add_tool(commands: Commands, name: str, main: Main, summary: str, target: str = "") -> Parser:
    parser = add_command(commands, f"log {name}", main, summary)
    parser.add_argument("log", metavar="LOG", help="a recorded LCM log")
    if target:
        parser.add_argument(target, metavar=target.upper(), help="what is written")
    return parser


def join_tool(words: list[str]) -> list[str]:
    """`log info ...` as the one command that the parser knows."""
    return [f"log {words[1]}", *words[2:]] if words[:1] == ["log"] and words[1:2] and words[1] in TOOLS else words


def main(arguments: Namespace) -> int:
    from tessera_cli.supervision.sheriff_commands import log

    return log(arguments)


def info(arguments: Namespace) -> int:
    from tessera_cli.runs import log_tools

    return log_tools.info(arguments)


def gaps(arguments: Namespace) -> int:
    from tessera_cli.runs import log_tools

    return log_tools.gaps(arguments)


def cut(arguments: Namespace) -> int:
    from tessera_cli.runs import log_tools

    return log_tools.cut(arguments)


def filter_channels(arguments: Namespace) -> int:
    from tessera_cli.runs import log_tools

    return log_tools.filter_channels(arguments)


def export(arguments: Namespace) -> int:
    from tessera_cli.runs import log_tools

    return log_tools.export(arguments)
