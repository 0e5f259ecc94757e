"""tessera demo: a drive around a block of a simulated town, rendered into a log, and the whole stack run on it.

The log is kept and used again. Its name holds what was rendered and a hash of the sources that rendered it.
"""

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from tessera_cli.cli.options import add_force, add_free_port
from tessera_cli.cli.parsing import Commands, add_command, whole_number
from tessera_cli.console import say
from tessera_cli.errors import UserError
from tessera_cli.files import ROOT, absolute
from tessera_cli.simulator import simulator_hash

if TYPE_CHECKING:
    from tessera_cli.runs.run_folder import Result

SCENE = "street-short"
SENSOR = "stereo"
# Of sim:street-short: once around the block and some 40 m of it again.
NUM_FRAMES = 593


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "demo",
        main,
        "Shows that it works: a drive through a simulated town, the whole stack, and the result.",
        "The drive is rendered into logs/ once and used again.\n\nexamples:\n"
        "  procman/tessera demo\n  procman/tessera demo --frames 150\n",
    )
    parser.add_argument(
        "--frames",
        type=whole_number(30, NUM_FRAMES),
        metavar="N",
        default=NUM_FRAMES,
        help=f"only the first N frames of the drive, default all {NUM_FRAMES}; the last ones close the loop",
    )
    parser.add_argument(
        "--logs", metavar="DIR", help="where the rendered drive is kept and the run's folder is made, default logs/"
    )
    parser.add_argument("--out", metavar="DIR", help="the run's folder, default logs/<date-time>-demo")
    add_force(parser, "an earlier run in --out DIR may be replaced")
    add_free_port(parser)


def main(arguments: Namespace) -> int:
    from tessera_cli.cli.main import parse_arguments
    from tessera_cli.runs.launcher import run_stack
    from tessera_cli.runs.run_folder import new_folder

    folder = absolute(arguments.logs) if arguments.logs else ROOT / "logs"
    if not folder.is_dir():
        raise UserError(f"--logs {arguments.logs}: there is no folder {folder}.")
    log = folder / log_name(arguments.frames)
    if log.is_file():
        say(f"using the drive that was rendered before, {log}")
    else:
        _render(log, arguments.frames)
    out = arguments.out or folder / new_folder("demo").name
    options = ["--sensor", SENSOR, "--extractors", "2", "--tiles", "2x2", *(["--force"] if arguments.force else [])]
    options += ["--port", str(arguments.port)] if arguments.port else []
    return run_stack(parse_arguments(["run", f"log:{log}", *options, "--out", str(out)]), _present)


def _present(result: "Result", folder: Path) -> str:
    from tessera_cli.report.run_report import present_demo

    return present_demo(result, folder)


def log_name(num_frames: int) -> str:
    return f"demo-{SCENE}-{SENSOR}-{num_frames}-{simulator_hash()}.lcmlog"


def _render(log: Path, num_frames: int) -> None:
    from tessera_cli.cli.main import parse_arguments
    from tessera_cli.runs.recording import checksums_of, record
    from tessera_cli.runs.sources import parse_source

    source = f"sim:{SCENE}"
    say(f"rendering a drive through a simulated town into {log} (once; about {num_frames} MB)")
    arguments = parse_arguments(["record", source, str(log), "--sensor", SENSOR, "--frames", f"0:{num_frames}"])
    record(arguments, parse_source(source), log, keep_interrupted=False)
    for stale in log.parent.glob(f"demo-{SCENE}-{SENSOR}-*.lcmlog"):
        if not stale.name.endswith(f"-{simulator_hash()}.lcmlog"):
            say(f"removing {stale.name}, which was rendered by an older simulator")
            stale.unlink()
            checksums_of(stale).unlink(missing_ok=True)
