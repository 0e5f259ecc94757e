"""Where the view is shown: a window, a browser, a file, or a file beside one of these."""

import importlib.util
import os
import subprocess
import time
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from tessera_cli.console import say
from tessera_cli.errors import RunError, UserError
from tessera_cli.files import ROOT, absolute, replacing
from tessera_cli.interrupt import Interrupt
from tessera_cli.viewing.scene import Look
from tessera_cli.viewing.viewer_process import ViewerProcess, has_display, is_whole

if TYPE_CHECKING:
    from tessera_cli.viewing.rerun_sink import RerunSink

POLL_S = 0.1


class View:
    """One view while it is open."""

    def __init__(self, title: str, process: ViewerProcess | None, path: Path | None) -> None:
        self._title, self._process, self._path = title, process, path
        self._sink: RerunSink | None = None
        self._interrupt = Interrupt()

    def start(self, look: Look) -> "RerunSink":
        # What rerun says of a viewer that was closed is no news.
        os.environ.setdefault("RUST_LOG", "off")
        from tessera_cli.viewing.rerun_sink import RerunSink

        if self._process:
            self._process.wait_until_it_listens()
        self._sink = RerunSink(self._title, self._process.url if self._process else None, self._path, look)
        return self._sink

    def tell(self) -> None:
        """Where the view can be seen; all that was shown so far is there."""
        if self._sink and self._process:
            self._sink.flush()
        if self._process and self._process.page:
            say(f"the view is at {self._process.page}")
            say("Ctrl-C ends it. From another machine: ssh -L with the two ports of this address.")

    @property
    def is_over(self) -> bool:
        """The window was closed, or Ctrl-C."""
        return self._interrupt.requested or (self._process is not None and self._process.has_ended)

    def wait(self) -> None:
        """Until the window is closed or Ctrl-C; not at all where only a file is written."""
        while self._process and not self.is_over:
            time.sleep(POLL_S)
        self.explain_end()

    def explain_end(self) -> None:
        """Raises RunError if the viewer did not end well."""
        if self._process:
            self._process.explain_end()

    def close(self) -> None:
        if self._sink and not (self._process and self._process.has_ended and not self._path):
            self._sink.close()
        if self._process:
            self._process.stop()


@contextmanager
def open_view(arguments: Namespace, title: str) -> Iterator[View]:
    """The viewer starts at once, beside whatever is read to be shown. Raises UserError, RunError."""
    path = absolute(arguments.save) if arguments.save else None
    if path and (path.suffix != ".rrd" or path.is_dir() or not path.parent.is_dir()):
        raise UserError(f"{path} can't be written: name a file that ends in .rrd, in a folder that exists.")
    add_package()
    process = _start_viewer(arguments)
    try:
        if path is None:
            yield from _view(title, process, None)
        else:
            with replacing(path) as written:
                yield from _view(title, process, written)
                if not is_whole(written):
                    raise RunError(f"{path} could not be written whole: is there room on the disk?")
            say(f"the view is in {path}; procman/tessera view {path} shows it")
    finally:
        if process:
            process.stop()


def show_recording(arguments: Namespace, recording: Path) -> None:
    """A file that --save wrote, until the window is closed or Ctrl-C."""
    if not recording.is_file():
        raise UserError(f"{recording}: there is no such file.")
    add_package()
    if not is_whole(recording):
        say(f"{recording} is cut off or damaged: what can be read of it is shown")
    process = _open_viewer(arguments, recording)
    view = View(recording.stem, process, None)
    try:
        process.wait_until_it_listens()
        view.tell()
        view.wait()
    finally:
        view.close()


def add_package() -> None:
    """Installs rerun-sdk, unless it is there already. Raises RunError if that fails, after what setup.sh says."""
    script = 'root="$1"; . "$root/procman/setup.sh"; add_viewer'
    added = subprocess.run(["bash", "-euo", "pipefail", "-c", script, "tessera", str(ROOT)], stdin=subprocess.DEVNULL)
    importlib.invalidate_caches()
    if added.returncode != 0 or importlib.util.find_spec("rerun") is None:
        raise RunError("without the package rerun-sdk nothing can be shown.")


def _view(title: str, process: ViewerProcess | None, path: Path | None) -> Iterator[View]:
    view = View(title, process, path)
    try:
        yield view
    finally:
        view.close()


def _start_viewer(arguments: Namespace) -> ViewerProcess | None:
    """None where a file is all that is wanted."""
    if arguments.save and not arguments.web:
        return None
    return _open_viewer(arguments, None)


def _open_viewer(arguments: Namespace, recording: Path | None) -> ViewerProcess:
    in_browser = arguments.web or not has_display()
    if in_browser and not arguments.web:
        say("there is no display (DISPLAY is not set): the view is shown in a browser, as with --web")
    return ViewerProcess(arguments.web_port if in_browser else None, recording)
