"""Settings as section.key=value assignments, merged with the defaults and checked by the program tessera-settings."""

import re
import subprocess
import unicodedata
from pathlib import Path
from typing import Any

import yaml

from tessera_cli.constants import (
    FIRST_TILE_PORT_OFFSET,
    LAN_MESSAGE_BYTES,
    LAN_TILE_GROUP,
    LAN_WORK_MESSAGE_BYTES,
    STACK_BUSES,
)
from tessera_cli.errors import UserError
from tessera_cli.files import BIN, ROOT
from tessera_cli.lcm_bus import stack_bus_url
from tessera_cli.text import visible

DEFAULTS_PATH = ROOT / "config" / "default.yaml"

Settings = dict[str, dict[str, Any]]  # sections of keys


def network_assignments(port: int, on_lan: bool) -> list[str]:
    """The buses of a stack with this base port; `on_lan`: their messages leave this machine."""
    assignments = [f"bus.{bus}_url={stack_bus_url(bus, port, on_lan)}" for bus in STACK_BUSES]
    assignments.append(f"bus.first_tile_port={port + FIRST_TILE_PORT_OFFSET}")
    if on_lan:
        tile_url = f"udpm://{LAN_TILE_GROUP}:{{port}}?ttl=1"
        assignments.append(f"bus.tile_url={tile_url}")
        assignments.append(f"bus.max_message_bytes={LAN_MESSAGE_BYTES}")
        assignments.append(f"bus.max_work_message_bytes={LAN_WORK_MESSAGE_BYTES}")
        assignments.append("dispatcher.pack_tiles=true")
    return assignments


def without_password(text: str) -> str:
    """For what others may read: rtsp://user:***@host instead of rtsp://user:password@host."""
    return re.sub(r"(://[^/@:\s]*):[^/@\s]*@", r"\1:***@", text)


def channel_prefix_of(assignments: list[str]) -> str:
    """The channel prefix that the assignments ask for; the last one counts."""
    values = [text.partition("=")[2] for text in assignments if text.startswith("bus.channel_prefix=")]
    return values[-1] if values else ""


def write_settings(assignments: list[str], path: Path, base: Path | None = None) -> Settings:
    """Writes all settings to `path` and returns them. Raises UserError with the sentence of tessera-settings.

    `base`: a file of settings that differ from the defaults; the assignments are stronger.

    Nobody else can read the file: the address of a camera may hold a password.
    """
    for assignment in assignments:
        if any(unicodedata.category(character) in ("Cc", "Cs") for character in assignment):
            raise UserError(
                f"the setting {visible(assignment)} holds a control character, or bytes that are not UTF-8."
            )
    command: list[str | Path] = [BIN / "tessera-settings", "--defaults", DEFAULTS_PATH, "--out", path]
    if base is not None:
        command += ["--file", base]
    for assignment in assignments:
        command += ["--set", assignment]
    merged = subprocess.run(command, capture_output=True, text=True, umask=0o077)
    if merged.returncode != 0:
        raise UserError(merged.stderr.strip())
    return yaml.safe_load(path.read_text())
