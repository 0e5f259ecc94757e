"""tessera demo: a drive around a block of a made town, rendered into a log, followed by the whole stack, and the result told.

The log is kept and used again. Its name holds what was rendered and a hash of the sources that rendered it.
"""

import datetime
import hashlib
import shutil
import sys
from argparse import Namespace
from pathlib import Path

from tessera_cli.cli.arguments import parse_arguments
from tessera_cli.errors import UserError
from tessera_cli.files import ROOT
from tessera_cli.runs import launcher as run
from tessera_cli.runs import recording as record
from tessera_cli.runs.sources import parse_source

SCENE = "street-short"
SENSOR = "stereo"
# Everything that a frame passes through on its way into a log.
RENDERED_BY = (
    "lcmtypes",
    "modules/core",
    "modules/geometry",
    "modules/simulation",
    "modules/datasets",
    "modules/transport",
    "modules/stages/camera",
)
SUFFIXES = (".cc", ".h", ".lcm")
PICTURE_COLUMNS, PICTURE_LINES = 64, 24


def main(arguments: Namespace) -> int:
    folder = Path(arguments.logs).expanduser().absolute() if arguments.logs else ROOT / "logs"
    if not folder.is_dir():
        raise UserError(f"--logs {arguments.logs}: there is no folder {folder}.")
    log = folder / log_name(arguments.frames)
    if log.is_file():
        print(f"tessera: using the drive that was rendered before, {log}", flush=True)
    else:
        _render(log, arguments.frames)
    out = arguments.out or folder / f"{datetime.datetime.now():%Y-%m-%d-%H%M%S}-demo"
    replay = parse_arguments(
        [
            "replay",
            str(log),
            "--sensor",
            SENSOR,
            "--extractors",
            "2",
            "--tiles",
            "2x2",
            "--port",
            str(arguments.port),
            "--out",
            str(out),
        ]
    )
    return run.main(replay, _tell)


def log_name(num_frames: int) -> str:
    return f"demo-{SCENE}-{SENSOR}-{num_frames}-{_version()}.lcmlog"


def _version() -> str:
    """Of the simulator: another one renders other bytes."""
    digest = hashlib.sha256()
    for top in RENDERED_BY:
        for path in sorted((ROOT / top).rglob("*")):
            if path.suffix in SUFFIXES:
                digest.update(f"{path.relative_to(ROOT)}\0".encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def _render(log: Path, num_frames: int) -> None:
    source = f"sim:{SCENE}"
    print(f"tessera: rendering a drive through a made town into {log} (once; about {num_frames} MB)", flush=True)
    arguments = parse_arguments(["record", source, str(log), "--sensor", SENSOR, "--frames", f"0:{num_frames}"])
    record.record(arguments, parse_source(source), log, keep_interrupted=False)
    for stale in log.parent.glob(f"demo-{SCENE}-{SENSOR}-*.lcmlog"):
        if not stale.name.endswith(f"-{_version()}.lcmlog"):
            print(f"tessera: removing {stale.name}, which an older simulator rendered", flush=True)
            stale.unlink()


def _tell(summary: dict, folder: Path) -> str:
    from tessera_cli.report.sentences import headline, remarks
    from tessera_cli.runs.run_folder import read_run

    result = read_run(folder)
    lines = [*headline(result)] + (remarks(result) if summary["ended"] != "complete" else [])
    return "\n".join(
        [
            "",
            *_picture(result),
            *lines,
            "",
            f"picture: {folder / 'trajectory.png'}",
            f"report:  {folder / 'report.html'}  (open it in a browser)",
        ]
    )


def _picture(result) -> list[str]:
    """For people in front of a terminal."""
    from tessera_cli.report.terminal_plot import draw_from_above

    if result.estimate is None or not sys.stdout.isatty():
        return []
    columns, lines = shutil.get_terminal_size()
    return [
        "The way from above, blue over the true one in grey:",
        "",
        draw_from_above(result, min(columns - 2, PICTURE_COLUMNS), min(lines // 2, PICTURE_LINES), colored=True),
        "",
    ]
