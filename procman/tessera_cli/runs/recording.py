"""A source recorded into an LCM log that stock lcm-logplayer can play.

The camera process writes into the log as fast as it can read its source. The events carry the times at which the frames
were taken, so that a player keeps the true pace.
"""

import os
import tempfile
import time
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path

from tessera_cli.console import say
from tessera_cli.constants import CAMERA, END_OF_STREAM, RECORDER_STOP_TIMEOUT_S, RECORDING_POLL_S
from tessera_cli.errors import RunError, UserError
from tessera_cli.files import absolute, unfinished
from tessera_cli.interrupt import Interrupt
from tessera_cli.lcm_bus import log_messages
from tessera_cli.messages import end_of_stream_t
from tessera_cli.runs.live_view import make_counter
from tessera_cli.runs.log_tail import LogTail
from tessera_cli.runs.run_settings import source_assignments, user_assignments
from tessera_cli.runs.sources import Source, parse_source
from tessera_cli.settings import channel_prefix_of, write_settings
from tessera_cli.supervision.private_deputy import PrivateDeputy, single_process
from tessera_cli.supervision.state_folder import LogFolder


def record_source(arguments: Namespace) -> int:
    """`tessera record`."""
    source = parse_source(arguments.source)
    if not source.has_camera_process:
        raise UserError(f"{arguments.source} is on the bus already: record it with .venv/bin/lcm-logger.")
    log = _check_target(arguments.log, arguments.force)
    num_frames = record(arguments, source, log, keep_interrupted=True)
    say(f"{num_frames} frames, {log.stat().st_size / 1e6:.1f} MB in {log}")
    return 0


def record(arguments: Namespace, source: Source, log: Path, keep_interrupted: bool) -> int:
    """Returns the number of frames in the log, which gets its name when it is complete.

    Ctrl-C ends the stream early or, without `keep_interrupted`, leaves no log and raises KeyboardInterrupt.
    """
    written, interrupt = unfinished(log), Interrupt()
    try:
        with tempfile.TemporaryDirectory(prefix="tessera-record-") as folder:
            _write_log(arguments, source, written, Path(folder), interrupt, keep_interrupted)
        num_frames = count_frames(written, channel_prefix_of(arguments.settings))
        if interrupt.requested and not keep_interrupted:
            raise KeyboardInterrupt
        checksums_of(log).unlink(missing_ok=True)  # of an earlier log
        os.replace(written, log)
        os.replace(checksums_of(written), checksums_of(log))
    finally:
        written.unlink(missing_ok=True)
        checksums_of(written).unlink(missing_ok=True)
        _part(written).unlink(missing_ok=True)
        checksums_of(_part(written)).unlink(missing_ok=True)
    return num_frames


def checksums_of(log: Path) -> Path:
    """What the writer of a log puts beside it (modules/wire/log_file.h)."""
    return log.with_name(f"{log.name}.checksums")


def _part(log: Path) -> Path:
    """What the camera process writes until it renames it to `log`."""
    return log.with_name(f"{log.name}.part")


def _check_target(text: str, force: bool) -> Path:
    log = absolute(text)
    if not log.parent.is_dir():
        raise UserError(f"there is no folder {log.parent} to write {log.name} into.")
    if log.is_dir() or "?" in str(log):
        raise UserError(f"{log} can't be a log's name: give a file, without a question mark.")
    if log.exists() and not force:
        raise UserError(f"{log} is there already; name another file, or add --force to replace it.")
    return log


def _write_log(
    arguments: Namespace, source: Source, log: Path, folder: Path, interrupt: Interrupt, keep_interrupted: bool
) -> None:
    url = f"file://{log}?mode=w"
    assignments = source_assignments(arguments, source, arguments.color) + user_assignments(arguments)
    write_settings([*assignments, f"bus.main_url={url}", f"bus.camera_url={url}"], folder / "settings.yaml")
    logs = LogFolder(folder, f"{folder} is in use.")
    camera = single_process("camera", "camera", RECORDER_STOP_TIMEOUT_S)
    deputy = PrivateDeputy(logs, folder / "settings.yaml", [camera])
    tail = LogTail(_part(log), channel_prefix_of(arguments.settings) + CAMERA)
    first, last = arguments.frames
    try:
        deputy.start()
        with make_counter(f"recording {source.name}", last - first if last >= 0 else None) as view:
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
            deputy.request_stop(["camera"])
        show()
        time.sleep(RECORDING_POLL_S)
        deputy.step()


def count_frames(log: Path, channel_prefix: str) -> int:
    """As the camera counted them at the end of its stream. Raises RunError if the log has no end."""
    counts = [end_of_stream_t.decode(data).num_frames for data in log_messages(log, channel_prefix + END_OF_STREAM)]
    if not counts:
        raise RunError(f"the camera wrote no end of its stream into {log}.")
    return counts[-1]
