"""tessera record: a source into an LCM log that stock lcm-logplayer can play.

The camera process writes into the log as fast as it can read its source; the events carry the times at which the frames
were taken, so that a player keeps the true pace.
"""

import os
import tempfile
import time
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path

import lcm

from tessera_cli import settings
from tessera_cli.errors import RunFailed, UserError
from tessera_cli.files import unfinished
from tessera_cli.interrupt import Interrupt
from tessera_cli.messages import end_of_stream_t
from tessera_cli.runs.live_view import make_count
from tessera_cli.runs.log_tail import LogTail
from tessera_cli.runs.sources import Source, parse_source
from tessera_cli.supervision.private_deputy import PrivateDeputy, helper
from tessera_cli.supervision.state_folder import LogFolder

POLL_S = 0.1
# After Ctrl-C the camera ends its stream and what is written goes to the disk.
STOP_TIME_S = 60.0


def main(arguments: Namespace) -> int:
    source = parse_source(arguments.source)
    if not source.has_camera_process:
        raise UserError(f"{arguments.source} is on the bus already: record it with .venv/bin/lcm-logger.")
    log = _check_target(arguments.log)
    num_frames = record(arguments, source, log, keep_interrupted=True)
    print(f"tessera: {num_frames} frames, {log.stat().st_size / 1e6:.1f} MB in {log}")
    return 0


def record(arguments: Namespace, source: Source, log: Path, keep_interrupted: bool) -> int:
    """The number of frames in the log, which appears under its name when it is whole. Ctrl-C ends its stream early, or,
    without `keep_interrupted`, leaves no log and raises KeyboardInterrupt."""
    written, interrupt = unfinished(log), Interrupt()
    try:
        with tempfile.TemporaryDirectory(prefix="tessera-record-") as folder:
            _write_log(arguments, source, written, Path(folder), interrupt, keep_interrupted)
        num_frames = count_frames(written, settings.prefix_of(arguments.settings))
        if interrupt.requested and not keep_interrupted:
            raise KeyboardInterrupt
        os.replace(written, log)
    finally:
        written.unlink(missing_ok=True)
        _part(written).unlink(missing_ok=True)
    return num_frames


def _part(log: Path) -> Path:
    """What the camera process writes, until it gives it the log's name."""
    return log.with_name(f"{log.name}.part")


def _check_target(text: str) -> Path:
    log = Path(text).expanduser().absolute()
    if not log.parent.is_dir():
        raise UserError(f"there is no folder {log.parent} to write {log.name} into.")
    if log.is_dir() or "?" in str(log):
        raise UserError(f"{log} can't be a log's name: give a file, without a question mark.")
    return log


def _write_log(
    arguments: Namespace, source: Source, log: Path, folder: Path, interrupt: Interrupt, keep_interrupted: bool
) -> None:
    url = f"file://{log}?mode=w"
    assignments = settings.source_assignments(arguments, source) + settings.user_assignments(arguments)
    settings.write_settings(assignments + [f"bus.main_url={url}", f"bus.camera_url={url}"], folder / "settings.yaml")
    deputy = PrivateDeputy(
        LogFolder(folder, f"{folder} is in use."), folder / "settings.yaml", [helper("camera", "camera", STOP_TIME_S)]
    )
    tail = LogTail(_part(log), f"{settings.prefix_of(arguments.settings)}CAMERA")
    first, last = arguments.frames
    try:
        deputy.start()
        with make_count(f"recording {source.name}", last - first if last >= 0 else None) as view:
            _wait(deputy, interrupt, lambda: view.update(max(0, tail.num_frames() - first)), keep_interrupted)
        deputy.require_success("camera")
    finally:
        deputy.kill()


def _wait(deputy: PrivateDeputy, interrupt: Interrupt, show: Callable[[], None], keep_interrupted: bool) -> None:
    """Until the camera has ended."""
    while not deputy.is_over:
        if interrupt.requested and not keep_interrupted:
            raise KeyboardInterrupt
        if interrupt.requested:
            deputy.dismiss(["camera"])
        show()
        time.sleep(POLL_S)
        deputy.step()


def count_frames(log: Path, channel_prefix: str) -> int:
    events = lcm.EventLog(str(log), "r")
    numbers = [
        end_of_stream_t.decode(event.data).num_frames
        for event in events
        if event.channel == f"{channel_prefix}END_OF_STREAM"
    ]
    events.close()
    if not numbers:
        raise RunFailed(f"the camera wrote no end of its stream into {log}.")
    return numbers[-1]
