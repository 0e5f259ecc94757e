"""performance.html: whole, self-contained, and told in words."""

from pathlib import Path

import pytest

from helpers.comparisons import make_comparison, make_measurement
from helpers.page import Page
from helpers.recorded_log import write_log
from tessera_cli.experiments.comparison_page import headline, write_comparison_page
from tessera_cli.experiments.events import read_log
from tessera_cli.experiments.gantt import draw_gantt
from tessera_cli.experiments.timeline import reconstruct


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Page:
    folder = tmp_path_factory.mktemp("page")
    comparison = make_comparison(
        [make_measurement(frames_per_s=speed, busy_ms={"mapper": 10.0}) for speed in (80.0, 70.0)],
        [make_measurement()] * 2,
    )
    gantt = draw_gantt("a drive mono", {"abc": reconstruct(read_log(write_log(folder / "run.lcmlog")), None)})
    assert gantt
    path = folder / "performance.html"
    write_comparison_page(path, ["abc with changes", "f1d2cc7"], [comparison], [gantt], ["A remark <b>."])
    return Page(path)


def test_it_tells_what_was_compared_and_what_came_out(page: Page) -> None:
    assert page.root.all("h1")[0].words().strip() == "Performance: abc with changes against f1d2cc7"
    words = " ".join(page.root.words().split())
    for expected in ("A remark <b>.", "a drive mono", "≥ 2.00x", "1.88x", "missed", "met", "mapper 80 %"):
        assert expected in words, expected


def test_nothing_is_fetched(page: Page) -> None:
    for element in page.every():
        assert element.tag not in ("script", "link", "iframe", "object", "embed", "img")


def test_every_figure_is_told_in_words(page: Page) -> None:
    figures = page.root.all("figure")
    assert len(figures) == 3  # the way of a frame, CPU time, the speed of each run
    for figure in figures:
        assert figure.all("figcaption")[0].words().strip()
        for svg in figure.all("svg"):
            assert len(svg.attributes["aria-label"].split()) > 5


def test_ids_are_unique(page: Page) -> None:
    ids = [element.attributes["id"] for element in page.every() if "id" in element.attributes]
    assert len(ids) == len(set(ids))


def test_rows_have_as_many_cells_as_the_heading(page: Page) -> None:
    table = page.root.all("table")[0]
    columns = len(table.all("thead")[0].all("th"))
    for row in table.all("tbody")[0].all("tr"):
        cells = row.all("th") + row.all("td")
        assert sum(int(cell.attributes.get("colspan", "1")) for cell in cells) == columns


def test_one_run_of_one_commit_has_a_page_too(tmp_path: Path) -> None:
    write_comparison_page(tmp_path / "page.html", ["abc"], [make_comparison([make_measurement()], [])], [None], [])
    assert Page(tmp_path / "page.html").root.all("h1")[0].words().strip() == "Performance"


def test_the_headline_counts_targets_and_names_those_that_are_missed() -> None:
    sentences = headline([make_comparison([make_measurement(error_m=0.7)], [])])
    assert sentences == ["1 of 2 targets are met.", "Missed: a drive mono (RMS error [m])."]
