"""SOURCE on the command line: its kind, whether it exists, and how the camera process gets it."""

import re
from dataclasses import dataclass
from pathlib import Path

from tessera_cli.errors import UserError

FOLDERS = ("kitti", "euroc", "tum")
FILES = ("video", "log")


@dataclass(frozen=True)
class Source:
    """Where frames come from."""

    kind: str  # kitti, euroc, tum, video, log, camera, rtsp, sim, bus
    text: str  # as the camera process gets it, with an absolute path; for bus: the URL, empty for the main bus
    name: str  # short, for the run's folder

    @property
    def is_live(self) -> bool:
        """Whether Ctrl-C is an ordinary way to end it."""
        return self.kind in ("camera", "rtsp", "bus")

    @property
    def has_camera_process(self) -> bool:
        return self.kind != "bus"


def parse_source(text: str) -> Source:
    """Raises UserError if the source is malformed or does not exist."""
    kind, colon, rest = text.partition(":")
    if not colon:
        raise UserError(
            f"source '{text}' has no kind: write kitti:DIR, euroc:DIR, tum:DIR, video:FILE, log:FILE, ...; "
            "procman/tessera run --help lists all."
        )
    if kind in FOLDERS or kind in FILES:
        return _stored_source(kind, rest)
    if kind == "camera":
        if not re.fullmatch(r"\d{1,3}", rest):
            raise UserError(f"source '{text}': write camera:N, where /dev/videoN is the device.")
        return Source(kind, text, f"camera-{rest}")
    if kind == "rtsp":
        return Source(kind, text, "rtsp")
    if kind == "sim":
        return _simulated_source(rest)
    if kind == "bus":
        if rest and not rest.startswith("udpm://"):
            raise UserError(f"source '{text}': write bus: or bus:udpm://GROUP:PORT?ttl=0.")
        return Source(kind, rest, "bus")
    raise UserError(
        f"source '{text}' is of no known kind: write kitti:DIR, euroc:DIR, tum:DIR, video:FILE, camera:N, "
        "rtsp://..., sim:NAME, log:FILE or bus:."
    )


def _stored_source(kind: str, rest: str) -> Source:
    path = Path(rest).expanduser().resolve()
    if not rest:
        raise UserError(f"source '{kind}:' names no path.")
    if kind in FOLDERS and not path.is_dir():
        raise UserError(f"source '{kind}:{rest}': there is no folder {path}.")
    if kind in FILES and not path.is_file():
        raise UserError(f"source '{kind}:{rest}': there is no file {path}.")
    stem = path.stem if kind in FILES else path.name
    return Source(kind, f"{kind}:{path}", f"{kind}-{re.sub(r'[^A-Za-z0-9_.-]+', '_', stem)}")


def _simulated_source(rest: str) -> Source:
    """The camera process checks the options; here only the path of a drive is made absolute."""
    options = [
        f"path={Path(option[5:]).expanduser().resolve()}" if option.startswith("path=") else option
        for option in rest.split(",")
    ]
    return Source("sim", "sim:" + ",".join(options), f"sim-{options[0]}")
