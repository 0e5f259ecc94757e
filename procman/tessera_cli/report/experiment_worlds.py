"""tessera experiment worlds: how hard a source is for mono odometry, so that the made worlds can be held against real ones."""

import csv
import datetime
import subprocess
from dataclasses import dataclass, fields
from pathlib import Path

from tessera_cli.errors import RunFailed, UserError
from tessera_cli.files import BUILD, ROOT, write_text
from tessera_cli.runs.sources import parse_source

PROGRAM = BUILD / "tests" / "benchmarks" / "offline_slam"
RECORDED = ROOT.parent / "shared" / "data"
# The real yardsticks where they are at hand, and the made worlds with as many frames.
REAL = ("kitti:{}/kitti/sequences/03", "kitti:{}/torcs/g-track-3")
MADE = ("sim:street", "sim:street,seed=7", "sim:street-short")
NUM_FRAMES = 801
HEADINGS = {
    "corners_per_image": "keypoints sent an image",
    "matches_per_frame": "matches a frame",
    "observations_per_landmark": "track length (keyframes)",
    "drift_percent": "drift (% of the way)",
    "length_m": "way (m)",
    "frames": "frames",
    "lost": "lost",
}


@dataclass(frozen=True)
class Row:
    source: str
    corners_per_image: float  # keypoints that extraction sends; 2000 where there are enough corners
    matches_per_frame: float  # with landmarks, inliers
    observations_per_landmark: float
    drift_percent: float  # RMS error after Sim(3) alignment, without loop closing
    length_m: float
    frames: float
    lost: float


def measure_worlds(sources: list[str]) -> int:
    folder = ROOT / "logs" / f"{datetime.datetime.now():%Y-%m-%d-%H%M%S}-experiment-worlds"
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for text in sources or default_sources():
        source = parse_source(text)
        print(f"tessera: {source.text}, mono, at most {NUM_FRAMES} frames; takes a minute", flush=True)
        rows.append(measure(source.text, folder / source.name))
    table = as_markdown(rows)
    write_text(folder / "worlds.md", table)
    print(f"\n{table}\nTable and trajectories: {folder}")
    return 0


def default_sources() -> list[str]:
    return [
        text.format(RECORDED) for text in REAL if Path(text.format(RECORDED).removeprefix("kitti:")).is_dir()
    ] + list(MADE)


def measure(source: str, folder: Path) -> Row:
    if not PROGRAM.is_file():
        raise RunFailed(f"{PROGRAM} is missing; procman/tessera setup builds it.")
    finished = subprocess.run([PROGRAM, source, "mono", folder, f"last={NUM_FRAMES}"], capture_output=True, text=True)
    if finished.returncode != 0:
        raise UserError(f"{finished.stderr.strip()}.")
    with open(folder / "figures.csv", newline="") as file:
        figures = {name: float(value) for name, value in next(csv.DictReader(file)).items()}
    known = {name: figures[name] for name in (field.name for field in fields(Row)) if name in figures}
    return Row(source=source, drift_percent=100.0 * figures["rms_m"] / figures["length_m"], **known)


def as_markdown(rows: list[Row]) -> str:
    lines = ["| source | " + " | ".join(HEADINGS.values()) + " |", "|---" * (len(HEADINGS) + 1) + "|"]
    for row in rows:
        figures = " | ".join(
            f"{getattr(row, name):.3g}" if name == "drift_percent" else f"{getattr(row, name):.5g}" for name in HEADINGS
        )
        lines.append(f"| {row.source} | {figures} |")
    return "\n".join(lines) + "\n"
