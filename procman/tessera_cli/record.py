"""tessera record: a source into an LCM log that stock lcm-logplayer can play.

The camera process writes into the log as fast as it can read its source; the events carry the times at which the frames
were taken, so that a player keeps the true pace.
"""

import os
import tempfile
import time
from argparse import Namespace
from pathlib import Path

import lcm

from tessera_cli import settings
from tessera_cli.errors import RunFailed, UserError
from tessera_cli.files import BIN, unfinished
from tessera_cli.interrupt import Interrupt
from tessera_cli.panel import LINE_PERIOD_S
from tessera_cli.processes import StageProcess
from tessera_cli.sources import Source, parse_source
from tessera_cli.types import end_of_stream_t

POLL_S = 0.05


def main(arguments: Namespace) -> int:
    source = parse_source(arguments.source)
    if not source.has_camera_process:
        raise UserError(f"{arguments.source} is on the bus already: record it with .venv/bin/lcm-logger.")
    log = _check_target(arguments.log)
    written = unfinished(log)
    try:
        with tempfile.TemporaryDirectory(prefix="tessera-record-") as folder:
            _write_log(arguments, source, written, Path(folder))
        num_frames = count_frames(written, settings.prefix_of(arguments.settings))
        os.replace(written, log)
    finally:
        written.unlink(missing_ok=True)
    print(f"tessera: {num_frames} frames, {log.stat().st_size / 1e6:.1f} MB in {log}")
    return 0


def _check_target(text: str) -> Path:
    log = Path(text).expanduser().absolute()
    if not log.parent.is_dir():
        raise UserError(f"there is no folder {log.parent} to write {log.name} into.")
    if log.is_dir() or "?" in str(log):
        raise UserError(f"{log} can't be a log's name: give a file, without a question mark.")
    return log


def _write_log(arguments: Namespace, source: Source, log: Path, folder: Path) -> None:
    url = f"file://{log}?mode=w"
    assignments = settings.source_assignments(arguments, source) + settings.user_assignments(arguments)
    settings.write_settings(assignments + [f"bus.main_url={url}", f"bus.camera_url={url}"], folder / "settings.yaml")
    camera = StageProcess("camera", [str(BIN / "tessera-camera"), "--settings", str(folder / "settings.yaml"), "--name", "camera"],
                          folder / "camera.log")
    interrupt = Interrupt()
    camera.start()
    try:
        status = _wait(camera, interrupt, log)
    finally:
        camera.kill()
    camera.require_success(status)


def _wait(camera: StageProcess, interrupt: Interrupt, log: Path) -> int:
    """The camera's exit status. Ctrl-C ends its stream, which leaves a whole log."""
    said_at, asked_to_end = time.monotonic(), False
    while (status := camera.poll()) is None:
        if interrupt.requested and not asked_to_end:
            camera.ask_to_end()
            asked_to_end = True
        if time.monotonic() - said_at > LINE_PERIOD_S and log.exists():
            said_at = time.monotonic()
            print(f"tessera: {log.stat().st_size / 1e6:.0f} MB written", flush=True)
        time.sleep(POLL_S)
    return status


def count_frames(log: Path, channel_prefix: str) -> int:
    events = lcm.EventLog(str(log), "r")
    numbers = [end_of_stream_t.decode(event.data).num_frames for event in events if event.channel == f"{channel_prefix}END_OF_STREAM"]
    events.close()
    if not numbers:
        raise RunFailed(f"the camera wrote no end of its stream into {log}.")
    return numbers[-1]
