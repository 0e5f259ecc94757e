"""tessera spy: lcm-spy with Tessera's message types."""

import os
from argparse import Namespace

from tessera_cli.cli.options import add_lan
from tessera_cli.cli.parsing import Commands, add_command
from tessera_cli.console import say
from tessera_cli.constants import PORT_OFFSETS
from tessera_cli.errors import RunError
from tessera_cli.files import BUILD, ROOT


def add_parser(commands: Commands) -> None:
    summary, examples = "lcm-spy with Tessera's message types.", "examples:\n  procman/tessera spy --bus camera\n"
    parser = add_command(commands, "spy", main, summary, examples)
    parser.add_argument("--bus", choices=tuple(PORT_OFFSETS), default="main", help="default main")
    add_lan(parser)


def main(arguments: Namespace) -> int:
    from tessera_cli.lcm_bus import is_on_lan, stack_bus_url

    jar = BUILD / "tessera_types.jar"
    if not jar.is_file():
        hint = "the build makes it where a JDK is installed; procman/tessera setup installs one"
        raise RunError(f"{jar} is missing: {hint}.")
    if not os.environ.get("DISPLAY"):
        raise RunError("lcm-spy is a window and needs a display, but DISPLAY is not set.")
    url = stack_bus_url(arguments.bus, arguments.port, is_on_lan(arguments))
    class_path = os.pathsep.join(filter(None, [str(jar), os.environ.get("CLASSPATH")]))
    os.environ.update(CLASSPATH=class_path, LCM_DEFAULT_URL=url)
    say(f"lcm-spy on {url}")
    spy = ROOT / ".venv" / "bin" / "lcm-spy"
    os.execv(spy, [str(spy), f"--lcm-url={url}"])
