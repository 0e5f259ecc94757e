"""The page and tables of a distribution experiment, and of two beside each other."""

import csv
import io
import json
from argparse import Namespace
from pathlib import Path

import pytest

from helpers.made_distribution import write_experiment
from helpers.page import Page
from tessera_cli.errors import UserError
from tessera_cli.experiments.distribution.claims import check_claims
from tessera_cli.experiments.distribution.experiment import compare_distributions
from tessera_cli.experiments.distribution.grid import HETEROGENEOUS, HOMOGENEOUS, SINGLE
from tessera_cli.experiments.distribution.outcome import read_outcome
from tessera_cli.experiments.distribution.page import write_distribution_page, write_pictures
from tessera_cli.experiments.distribution.tables import as_csv, as_json, as_markdown, make_grids, print_outcome
from tessera_cli.experiments.plan import DESCRIPTION


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_experiment(tmp_path_factory.mktemp("experiments") / "slow", HETEROGENEOUS)


@pytest.fixture(scope="module")
def page(folder: Path) -> Page:
    path = folder / "heterogeneous.html"
    write_pictures(folder / "pictures", write_distribution_page(path, [read_outcome(folder)], ["A remark <b>."]))
    return Page(path)


def test_an_experiment_is_read_from_its_folder(folder: Path) -> None:
    outcome = read_outcome(folder)
    assert outcome.extractors == [1, 4] and outcome.cuts == ["1x1", "2x2"]
    assert len(outcome.cells) == 7 and len(outcome.hashes) == 1
    assert outcome.calibration and outcome.calibration.share == 0.05


def test_other_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no experiment of these"):
        read_outcome(tmp_path)


def test_tables_have_cuts_as_rows_and_extractors_as_columns(folder: Path) -> None:
    grids = {grid.title: grid for grid in make_grids(read_outcome(folder))}
    failures = grids["Tracking failures – RMS error [m]"]
    assert failures.columns == [1, 4] and [tiles for tiles, _ in failures.rows] == ["1x1", "2x2"]
    wire = grids["Traffic [kB per frame]"]
    assert wire.rows[1][1] == ["600 (1.00x)", "600 (1.00x)"]
    alone = next(grid for title, grid in grids.items() if title.startswith("Latency"))
    assert alone.rows[0][1] == ["–", "–"] and alone.rows[1][1][1] == "65/70"


def test_the_terminal_shows_them_in_80_columns(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outcome = read_outcome(folder)
    print_outcome(outcome, check_claims(outcome))
    out = capsys.readouterr().out
    assert "Tracking failures – RMS error [m]" in out and "met: no tracking failure" in out
    assert all(len(line) <= 80 for line in out.splitlines())


def test_every_run_is_a_row_of_the_csv_file(folder: Path) -> None:
    rows = list(csv.DictReader(io.StringIO(as_csv(read_outcome(folder)))))
    assert len(rows) == 11
    assert {row["variant"] for row in rows} == {"", "alone", "killed", "loss"}
    assert all(row["trajectory_sha256"] == "ab" * 32 for row in rows)


def test_documents_get_the_same_tables(folder: Path) -> None:
    text = as_markdown(read_outcome(folder))
    assert "| cut | P = 1 | P = 4 |\n| --- | --- | --- |\n| 1x1 |" in text
    assert "**Tracking failures – RMS error [m].**" in text


def test_json_holds_bytes_of_each_link(folder: Path) -> None:
    outcome = read_outcome(folder)
    values = json.loads(json.dumps(as_json(outcome, check_claims(outcome), [])))
    assert values["runs"][0]["link_bytes"]["node2"] == {"sent": 60_000_000, "received": 12_000_000}
    assert values["calibration"]["step_ms"] == 201.0


def test_the_page_tells_claims_tables_and_remarks(page: Page) -> None:
    words = " ".join(page.root.words().split())
    for expected in ("Experiment heterogeneous", "A remark <b>.", "no tracking failure", "Poses per second", "P = 4"):
        assert expected in words, expected
    assert not [element for element in page.every() if element.tag in ("script", "link", "iframe", "img")]


def test_every_figure_is_told_in_words_and_is_a_small_file_too(page: Page, folder: Path) -> None:
    svgs = [svg for figure in page.root.all("figure") for svg in figure.all("svg")]
    assert len(page.root.all("figure")) == 6
    assert all(len(svg.attributes["aria-label"].split()) > 5 for svg in svgs)
    pictures = sorted((folder / "pictures").glob("*.svg"))
    assert len(pictures) == 6
    for picture in pictures:
        assert picture.stat().st_size < 60_000 and "var(--" not in picture.read_text()


def test_two_experiments_lie_beside_each_other(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = write_experiment(tmp_path / "fast", HOMOGENEOUS)
    description = json.loads((other / DESCRIPTION).read_text())
    (other / DESCRIPTION).write_text(json.dumps({**description, "settings": ["dispatcher.pack_tiles=false"]}))
    arguments = Namespace(first=str(folder), second=str(other), out=str(tmp_path / "new" / "both.html"))
    assert compare_distributions(arguments) == 0
    out = capsys.readouterr().out
    assert "bit for bit" in out and "differ: none and dispatcher.pack_tiles=false." in out
    words = " ".join(Page(tmp_path / "new" / "both.html").root.words().split())
    assert "slow and fast, beside each other" in words
    with pytest.raises(UserError, match="the same experiment"):
        compare_distributions(Namespace(first=str(folder), second=str(folder), out=None))


def test_one_host_has_no_link(tmp_path: Path) -> None:
    outcome = read_outcome(write_experiment(tmp_path / "one", SINGLE))
    assert make_grids(outcome)[5].rows[0][1][0] == "500 (1.00x)"
