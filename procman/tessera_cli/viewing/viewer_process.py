"""The viewer itself, a process of its own: a native window, or a server that shows the view in a browser."""

import importlib.util
import os
import socket
import subprocess
import sys
import time
from pathlib import Path

from tessera_cli.errors import RunError, UserError

LOOPBACK = "127.0.0.1"
# How long it takes a viewer to listen, also on a small busy machine.
START_TIMEOUT_S = 30.0
POLL_S = 0.02
STOP_TIMEOUT_S = 3.0
# The viewer drops the oldest of what it was sent when this is full.
MEMORY_LIMIT = "25%"
# Of the page: no advertisement while the view is loaded, and images on a dark ground as in a window.
PAGE_OPTIONS = "hide_welcome_screen&theme=dark"


class ViewerProcess:
    """Starts at once; what is sent to `url` before it listens waits there."""

    def __init__(self, web_port: int | None, recording: Path | None = None) -> None:
        """`web_port`: shown in a browser, at this port; None: in a window. `recording`: a file to begin with.

        Raises UserError if the port is taken.
        """
        self._is_window = web_port is None
        self.page = ""
        port = _free_port()
        self.url = f"rerun+http://{LOOPBACK}:{port}/proxy"
        command = [_program(), "--bind", LOOPBACK, "--port", str(port)]
        if recording:
            command.append(str(recording))
        if web_port is None:
            command += ["--memory-limit", MEMORY_LIMIT, "--expect-data-soon", "--hide-welcome-screen"]
        else:
            _require_free(web_port)
            command += ["--serve-web", "--web-viewer-port", str(web_port), "--server-memory-limit", MEMORY_LIMIT]
            # A page that is opened late shows at once what is newest.
            command.append("--newest-first")
            self.page = f"http://{LOOPBACK}:{web_port}?url={self.url.replace('+', '%2B')}&{PAGE_OPTIONS}"
        self._port = port
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env={**os.environ, **_quiet_environment()},
            start_new_session=True,  # Ctrl-C is for the command, which ends the viewer
        )

    def wait_until_it_listens(self) -> None:
        """Raises RunError if it ended instead."""
        deadline = time.monotonic() + START_TIMEOUT_S
        while time.monotonic() < deadline:
            if self.has_ended:
                raise RunError(self._why_it_ended())
            with socket.socket() as probe:
                if probe.connect_ex((LOOPBACK, self._port)) == 0:
                    return
            time.sleep(POLL_S)
        raise RunError("the viewer does not answer: is this machine very busy? Try again, or write a file with --save.")

    @property
    def has_ended(self) -> bool:
        return self._process.poll() is not None

    @property
    def has_failed(self) -> bool:
        return self.has_ended and self._process.returncode != 0

    def explain_end(self) -> None:
        """Raises RunError if the viewer did not end well."""
        if self.has_failed:
            raise RunError(self._why_it_ended())

    def stop(self) -> None:
        if not self.has_ended:
            self._process.terminate()
            try:
                self._process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()

    def _why_it_ended(self) -> str:
        assert self._process.stderr is not None
        lines = [line.strip() for line in self._process.stderr.read().decode(errors="replace").splitlines()]
        reasons = [line for line in lines if line.startswith("Error: ")] or lines or ["no reason given"]
        reason = reasons[-1]
        if self._is_window:
            return f"the viewer's window could not be kept open ({reason}); --web shows the view in a browser instead."
        return f"the web viewer ended ({reason})."


def is_whole(path: Path) -> bool:
    """Whether a file of the viewer has its end. Nobody hears of it where one can't be written any further."""
    command = [_program(), "rrd", "verify", str(path)]
    return subprocess.run(command, capture_output=True, env={**os.environ, **_quiet_environment()}).returncode == 0


def has_display() -> bool:
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _program() -> str:
    """The viewer itself: what pip puts beside python is a script that would leave it behind."""
    found = importlib.util.find_spec("rerun_cli")
    if found is None or not found.submodule_search_locations:
        raise RunError("the viewer's program is missing: was rerun-sdk installed whole? procman/tessera view does it.")
    return str(Path(found.submodule_search_locations[0]) / "rerun")


def _quiet_environment() -> dict[str, str]:
    """No usage statistics: setup.sh has turned them off in this folder of settings. And only errors are told."""
    return {"XDG_CONFIG_HOME": str(Path(sys.prefix) / "etc"), "RUST_LOG": "error"}


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def _require_free(port: int) -> None:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except OSError as error:
            raise UserError(
                f"port {port} of {LOOPBACK} can't be used ({error.strerror}): is another view open? "
                "Choose another one with --web-port N."
            ) from error
