"""Which simulator renders: logs of simulated drives are kept, and used again while it stays the same."""

import hashlib
from pathlib import Path

from tessera_cli.files import ROOT

# Everything that a frame passes through on its way into a log.
RENDERED_BY = (
    "lcmtypes",
    "modules/core",
    "modules/geometry",
    "modules/simulation",
    "modules/datasets",
    "modules/messages",
    "modules/wire",
    "modules/streams",
    "modules/runtime",
    "modules/stages/camera",
)
SUFFIXES = (".cc", ".h", ".lcm")


def simulator_hash(world: str = "") -> str:
    """Another simulator renders other bytes, and so does another drive, which a world may take from a file."""
    digest = hashlib.sha256()
    for top in RENDERED_BY:
        for path in sorted((ROOT / top).rglob("*")):
            if path.suffix in SUFFIXES:
                digest.update(f"{path.relative_to(ROOT)}\0".encode() + path.read_bytes())
    for option in world.split(","):
        if option.startswith("path=") and Path(option[5:]).is_file():
            digest.update(Path(option[5:]).read_bytes())
    return digest.hexdigest()[:12]
