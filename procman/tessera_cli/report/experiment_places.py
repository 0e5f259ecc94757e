"""tessera experiment places: recall and precision of place recognition, on sources with ground truth."""

import csv
import datetime
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tessera_cli.errors import RunFailed, UserError
from tessera_cli.files import BUILD, ROOT, write_text
from tessera_cli.runs.sources import Source, parse_source

PROGRAM = BUILD / "tests" / "benchmarks" / "place_recall"
VOCABULARY = ROOT / "config" / "vocabulary.tvoc"
# None of the shipped vocabulary's training images come from these.
SIMULATED = "sim:street,seed=7"
RECORDED = ROOT.parent / "shared" / "data" / "torcs" / "g-track-3"


@dataclass(frozen=True)
class Measured:
    name: str
    summary: str  # the program's own words
    answers: dict[str, np.ndarray]
    curve: dict[str, np.ndarray]


def measure_places(sources: list[str]) -> int:
    chosen = [parse_source(text) for text in sources] or default_sources()
    folder = ROOT / "logs" / f"{datetime.datetime.now():%Y-%m-%d-%H%M%S}-experiment-places"
    folder.mkdir(parents=True, exist_ok=True)
    measured = []
    for source in chosen:
        print(f"tessera: measuring place recognition on {source.text}; takes a minute or two", flush=True)
        measured.append(measure(source, folder / source.name))
        print(measured[-1].summary, flush=True)
    write_text(folder / "places.txt", "".join(f"{each.name}: {each.summary}\n" for each in measured))
    plot(measured, folder / "places.png")
    print(f"\nFigures and plot: {folder}")
    return 0


def default_sources() -> list[Source]:
    recorded = [f"kitti:{RECORDED}"] if RECORDED.is_dir() else []
    return [parse_source(text) for text in [*recorded, SIMULATED]]


def measure(source: Source, folder: Path) -> Measured:
    if not PROGRAM.is_file():
        raise RunFailed(f"{PROGRAM} is missing; procman/tessera setup builds it.")
    finished = subprocess.run([PROGRAM, source.text, folder, VOCABULARY], capture_output=True, text=True)
    if finished.returncode != 0:
        raise UserError(f"{finished.stderr.strip()}.")
    summary = finished.stdout.strip().removeprefix(f"{VOCABULARY}: ")
    return Measured(
        source.name,
        summary,
        read_columns(folder / f"{VOCABULARY.stem}_answers.csv"),
        read_columns(folder / f"{VOCABULARY.stem}_curve.csv"),
    )


def read_columns(path: Path) -> dict[str, np.ndarray]:
    with open(path, newline="") as file:
        heading, *rows = csv.reader(file)
    return {name: np.array([float(row[i]) for row in rows]) for i, name in enumerate(heading)}


def plot(measured: list[Measured], path: Path) -> None:
    from matplotlib.figure import Figure

    from tessera_cli.report.trajectory_plot import save

    figure = Figure(figsize=(13, 4 * len(measured)), layout="constrained")
    for (curve_axes, score_axes), each in zip(figure.subplots(len(measured), 2, squeeze=False), measured):
        curve_axes.plot(each.curve["recall"], each.curve["precision"], color="tab:blue")
        curve_axes.set(title=each.name, xlabel="recall", ylabel="precision", xlim=(0, 1.02), ylim=(0, 1.02))
        is_true = each.answers["is_true"] > 0
        for mask, color, label in ((~is_true, "tab:red", "another place"), (is_true, "tab:green", "the same place")):
            score_axes.plot(
                each.answers["frame"][mask],
                each.answers["normalized"][mask],
                ".",
                color=color,
                markersize=3,
                label=label,
            )
        score_axes.set(xlabel="frame", ylabel="best older place's score / neighbour's", ylim=(0, None))
        score_axes.legend()
        for axes in (curve_axes, score_axes):
            axes.grid(alpha=0.3)
    save(figure, path)
