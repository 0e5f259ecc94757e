"""Experiment worlds: how hard sources are for mono odometry, to compare simulated worlds with recorded ones."""

import csv
import subprocess
from dataclasses import dataclass, fields
from pathlib import Path

from tessera_cli.console import say
from tessera_cli.errors import RunError, UserError
from tessera_cli.files import BUILD, ROOT, write_text
from tessera_cli.runs.run_folder import new_folder
from tessera_cli.runs.sources import parse_source

PROGRAM = BUILD / "tests" / "benchmarks" / "offline_slam"
RECORDED = ROOT.parent / "shared" / "data"
# The recorded sources, where they exist, and the simulated worlds with as many frames.
REAL = ("kitti:{}/kitti/sequences/03", "kitti:{}/torcs/g-track-3")
SIMULATED = ("sim:street", "sim:street,seed=7", "sim:street-short")
NUM_FRAMES = 801
HEADINGS = {
    "corners_per_image": "keypoints per image",
    "matches_per_frame": "matches per frame",
    "observations_per_landmark": "track length (keyframes)",
    "drift_percent": "drift (% of the path)",
    "length_m": "path (m)",
    "frames": "frames",
    "lost": "lost",
}


@dataclass(frozen=True)
class Row:
    """The figures of one source."""

    source: str
    corners_per_image: float  # keypoints that extraction sends; 2000 where there are enough corners
    matches_per_frame: float  # with landmarks, inliers
    observations_per_landmark: float
    drift_percent: float  # RMS error after Sim(3) alignment, without loop closing
    length_m: float
    frames: float
    lost: float


def measure_worlds(sources: list[str]) -> int:
    folder = new_folder("experiment-worlds")
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for text in sources or default_sources():
        source = parse_source(text)
        say(f"{source.text}, mono, at most {NUM_FRAMES} frames; takes a minute")
        rows.append(measure(source.text, folder / source.name))
    table = as_markdown(rows)
    write_text(folder / "worlds.md", table)
    print(f"\n{table}\nTable and trajectories: {folder}")
    return 0


def default_sources() -> list[str]:
    real = [text.format(RECORDED) for text in REAL]
    return [text for text in real if Path(text.removeprefix("kitti:")).is_dir()] + list(SIMULATED)


def measure(source: str, folder: Path) -> Row:
    if not PROGRAM.is_file():
        raise RunError(f"{PROGRAM} is missing; procman/tessera setup builds it.")
    command: list[str | Path] = [PROGRAM, source, "mono", folder, f"last={NUM_FRAMES}"]
    finished = subprocess.run(command, capture_output=True, text=True)
    if finished.returncode != 0:
        raise UserError(f"{finished.stderr.strip()}.")
    with open(folder / "figures.csv", newline="") as file:
        figures = {name: float(value) for name, value in next(csv.DictReader(file)).items()}
    known = {name: figures[name] for name in (field.name for field in fields(Row)) if name in figures}
    return Row(source=source, drift_percent=100.0 * figures["rms_m"] / figures["length_m"], **known)


def as_markdown(rows: list[Row]) -> str:
    lines = ["| source | " + " | ".join(HEADINGS.values()) + " |", "|---" * (len(HEADINGS) + 1) + "|"]
    for row in rows:
        formats = {name: ".3g" if name == "drift_percent" else ".5g" for name in HEADINGS}
        figures = " | ".join(format(getattr(row, name), pattern) for name, pattern in formats.items())
        lines.append(f"| {row.source} | {figures} |")
    return "\n".join(lines) + "\n"
