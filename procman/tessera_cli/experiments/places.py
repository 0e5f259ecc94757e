"""Experiment places: recall and precision of place recognition, on sources with ground truth."""

import csv
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tessera_cli.console import say
from tessera_cli.errors import RunError, UserError
from tessera_cli.files import BUILD, ROOT, write_text
from tessera_cli.report.trajectory_plot import save_png
from tessera_cli.runs.run_folder import new_folder
from tessera_cli.runs.sources import Source, parse_source

PROGRAM = BUILD / "tests" / "benchmarks" / "place_recall"
VOCABULARY = ROOT / "config" / "vocabulary.tvoc"
# None of the shipped vocabulary's training images come from these.
SIMULATED = "sim:street,seed=7"
RECORDED = ROOT.parent / "shared" / "data" / "torcs" / "g-track-3"


@dataclass(frozen=True)
class Measurement:
    """Of one source."""

    name: str
    summary: str  # as printed by the program
    answers: dict[str, np.ndarray]
    curve: dict[str, np.ndarray]


def measure_places(sources: list[str]) -> int:
    chosen = [parse_source(text) for text in sources] or default_sources()
    folder = new_folder("experiment-places")
    folder.mkdir(parents=True, exist_ok=True)
    measurements = []
    for source in chosen:
        say(f"measuring place recognition on {source.text}; takes a minute or two")
        measurements.append(measure(source, folder / source.name))
        print(measurements[-1].summary, flush=True)
    write_text(folder / "places.txt", "".join(f"{each.name}: {each.summary}\n" for each in measurements))
    plot(measurements, folder / "places.png")
    print(f"\nFigures and plot: {folder}")
    return 0


def default_sources() -> list[Source]:
    recorded = [f"kitti:{RECORDED}"] if RECORDED.is_dir() else []
    return [parse_source(text) for text in [*recorded, SIMULATED]]


def measure(source: Source, folder: Path) -> Measurement:
    if not PROGRAM.is_file():
        raise RunError(f"{PROGRAM} is missing; procman/tessera setup builds it.")
    finished = subprocess.run([PROGRAM, source.text, folder, VOCABULARY], capture_output=True, text=True)
    if finished.returncode != 0:
        raise UserError(f"{finished.stderr.strip()}.")
    return Measurement(
        name=source.name,
        summary=finished.stdout.strip().removeprefix(f"{VOCABULARY}: "),
        answers=read_columns(folder / f"{VOCABULARY.stem}_answers.csv"),
        curve=read_columns(folder / f"{VOCABULARY.stem}_curve.csv"),
    )


def read_columns(path: Path) -> dict[str, np.ndarray]:
    with open(path, newline="") as file:
        heading, *rows = csv.reader(file)
    return {name: np.array([float(row[i]) for row in rows]) for i, name in enumerate(heading)}


def plot(measurements: list[Measurement], path: Path) -> None:
    """For each source, precision over recall and the score of each answer."""
    figure = Figure(figsize=(13, 4 * len(measurements)), layout="constrained")
    all_axes = figure.subplots(len(measurements), 2, squeeze=False)
    for (curve_axes, score_axes), each in zip(all_axes, measurements):
        curve_axes.plot(each.curve["recall"], each.curve["precision"], color="tab:blue")
        curve_axes.set(title=each.name, xlabel="recall", ylabel="precision", xlim=(0, 1.02), ylim=(0, 1.02))
        is_true = each.answers["is_true"] > 0
        for mask, color, label in ((~is_true, "tab:red", "another place"), (is_true, "tab:green", "the same place")):
            frames, scores = each.answers["frame"][mask], each.answers["normalized"][mask]
            score_axes.plot(frames, scores, ".", color=color, markersize=3, label=label)
        score_axes.set(xlabel="frame", ylabel="best older place's score / neighbor's", ylim=(0, None))
        score_axes.legend()
        for axes in (curve_axes, score_axes):
            axes.grid(alpha=0.3)
    save_png(figure, path)
