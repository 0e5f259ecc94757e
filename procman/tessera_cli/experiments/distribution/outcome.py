"""A distribution experiment as its folder holds it."""

import json
from dataclasses import dataclass
from pathlib import Path

from tessera_cli.errors import UserError
from tessera_cli.experiments.distribution.calibration import Calibration, read_calibration
from tessera_cli.experiments.distribution.figures import Cell, read_figures
from tessera_cli.experiments.distribution.grid import EXPERIMENTS, Configuration, Experiment, read_key, tile_count
from tessera_cli.experiments.plan import DESCRIPTION, RUNS, ExperimentFolder

CALIBRATION = "calibration.json"


@dataclass(frozen=True)
class Outcome:
    """All runs that came to their end."""

    name: str  # of the folder
    path: Path
    experiment: Experiment
    sequence: str
    cells: dict[Configuration, Cell]
    calibration: Calibration | None  # of slow nodes

    @property
    def extractors(self) -> list[int]:
        return sorted({each.extractors for each in self.cells})

    @property
    def cuts(self) -> list[str]:
        return sorted({each.tiles for each in self.cells}, key=lambda tiles: (tile_count(tiles), tiles))

    @property
    def num_frames(self) -> int:
        return max(run.measurement.frames for cell in self.cells.values() for run in cell.runs)

    def cell(self, extractors: int, tiles: str, variant: str = "") -> Cell | None:
        return self.cells.get(Configuration(extractors, tiles, variant))

    def of_variant(self, *variants: str) -> list[Cell]:
        """Coarse cuts first, then few extractors first."""
        chosen = [cell for each, cell in self.cells.items() if each.variant in variants]
        return sorted(chosen, key=lambda cell: (cell.configuration.num_tiles, cell.configuration.extractors))

    @property
    def hashes(self) -> set[tuple[str, str]]:
        """Of trajectory and map, over all runs; a law of the project wants one."""
        return set().union(*(cell.hashes for cell in self.cells.values()))


def read_outcome(path: Path) -> Outcome:
    """Raises UserError if the folder holds no distribution experiment with a run."""
    try:
        description = json.loads((path / DESCRIPTION).read_text())
        experiment, sequence = EXPERIMENTS[description["experiment"]], description["sequences"][0]
    except (OSError, ValueError, KeyError, IndexError, TypeError) as error:
        known = ", ".join(EXPERIMENTS)
        raise UserError(f"{path} holds no experiment of these: {known} (of tessera experiment NAME --out).") from error
    runs: dict[Configuration, list[Path]] = {}
    for folder in sorted((path / RUNS).glob("*/*")):
        configuration = read_key(folder.name.rpartition("-")[0])
        if configuration:
            runs.setdefault(configuration, []).append(folder)
    cells = {}
    for configuration, folders in runs.items():
        if figures := [each for folder in folders if (each := read_figures(folder))]:
            cells[configuration] = Cell(configuration, figures)
    if not cells:
        raise UserError(f"{path} holds no run that came to its end.")
    title = f"{sequence['name']} {sequence['sensor']}"
    return Outcome(path.name, path, experiment, title, cells, read_calibration(path / CALIBRATION))


def folder_of(outcome: Outcome, configuration: Configuration) -> Path:
    """Of one run of it."""
    folders = sorted((ExperimentFolder(outcome.path).path / RUNS).glob(f"*/{configuration.key}-*"))
    return folders[0]
