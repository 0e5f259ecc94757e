"""tessera record: a source into an LCM log that stock lcm-logplayer can play.

The camera process writes into the log as fast as it can read its source. LCM stamps each event with the time of writing;
a player paces itself by these stamps, so they are replaced by the times at which the frames were taken.
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
from tessera_cli.processes import StageProcess, describe_exit
from tessera_cli.sources import Source, parse_source
from tessera_cli.types import camera_image_t

POLL_S = 0.05


def main(arguments: Namespace) -> int:
    source = parse_source(arguments.source)
    if not source.has_camera_process:
        raise UserError(f"{arguments.source} is on the bus already: record it with .venv/bin/lcm-logger.")
    log = _check_target(arguments.log)
    written, stamped = unfinished(log), log.with_name(f".stamped-{log.name}")
    try:
        with tempfile.TemporaryDirectory(prefix="tessera-record-") as folder:
            _write_log(arguments, source, written, Path(folder))
        num_frames = stamp_by_frame_time(written, stamped, settings.prefix_of(arguments.settings))
        os.replace(stamped, log)
    finally:
        written.unlink(missing_ok=True)
        stamped.unlink(missing_ok=True)
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
    if status == 2:
        raise UserError(f"camera: {camera.last_words()}")
    if status != 0:
        raise RunFailed(f"camera {describe_exit(status)}: {camera.last_words()}")


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


def stamp_by_frame_time(written: Path, stamped: Path, channel_prefix: str) -> int:
    """Copies a log; each event gets the time of the frame that it belongs to or follows. Returns the number of frames."""
    frames: set[int] = set()
    first_utime = None
    with_times = lcm.EventLog(str(stamped), "w", overwrite=True)
    events = lcm.EventLog(str(written), "r")
    stamp = began = int(time.time() * 1e6)
    for event in events:
        if event.channel == f"{channel_prefix}CAMERA":
            image = camera_image_t.decode(event.data)
            frames.add(image.frame)
            first_utime = image.utime if first_utime is None else first_utime
            # Never back: a player would wait for ever.
            stamp = max(stamp, began + image.utime - first_utime)
        with_times.write_event(stamp, event.channel, event.data)
    events.close()
    with_times.close()
    return len(frames)
