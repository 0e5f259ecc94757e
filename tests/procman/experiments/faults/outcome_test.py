"""To which fault a pause belongs, and what the table says of runs that end well and of those that don't."""

import csv
import io
from pathlib import Path

import pytest

from helpers.page import Page
from tessera_cli.experiments.faults.outcome import (
    COMPLETE,
    Outcome,
    ThrownFault,
    attribute_pauses,
    longest_pause,
    read_outcome,
    write_outcome,
)
from tessera_cli.experiments.faults.page import write_faults_page
from tessera_cli.experiments.faults.tables import as_csv, as_json, headline, make_rows, print_table

HASHES = ("ab" * 32, "cd" * 32)
UNDISTURBED = Outcome(COMPLETE, HASHES, 0.4, [])


def fault(process: str, kind: str, pause_s: float | None = 1.0) -> ThrownFault:
    return ThrownFault(process, kind, 20, 3.0, 4.0, pause_s)


GOOD = Outcome(COMPLETE, HASHES, 3.0, [fault("mapper", "kill", 3.0), fault("extractor_0", "stop", 0.5)])
OTHER = Outcome(COMPLETE, ("ef" * 32, HASHES[1]), 2.0, [fault("extractor_1", "stop", 2.0)])
FAILED = Outcome("tracker was killed.", ("", ""), 1.5, [fault("mapper", "kill", 1.5), fault("tracker", "kill", None)])


def test_a_pause_belongs_to_the_last_fault_before_its_end() -> None:
    poses = [0.0, 1.0, 2.0, 5.0, 5.5, 6.0, 10.0, 10.1]
    assert attribute_pauses(poses, [2.5, 5.7]) == [3.0, 4.0]


def test_pauses_before_the_first_fault_belong_to_none() -> None:
    assert attribute_pauses([0.0, 9.0, 9.5, 10.0], [9.2]) == [0.5]
    assert longest_pause([0.0, 9.0, 9.5, 10.0]) == 9.0


def test_a_fault_that_no_pose_follows_has_no_pause() -> None:
    assert attribute_pauses([0.0, 1.0], [2.0]) == [None]
    assert attribute_pauses([], [2.0]) == [None]
    assert longest_pause([]) == 0.0


def test_a_run_is_like_the_undisturbed_one_if_it_ended_well_with_the_same_hashes() -> None:
    assert [run.is_like(UNDISTURBED) for run in (GOOD, OTHER, FAILED)] == [True, False, False]


def test_an_outcome_is_read_as_it_was_written(tmp_path: Path) -> None:
    assert read_outcome(tmp_path) is None
    write_outcome(tmp_path, FAILED)
    assert read_outcome(tmp_path) == FAILED


def test_each_process_and_kind_is_a_row_and_the_last_fault_of_a_failed_run_ended_it() -> None:
    rows = make_rows(UNDISTURBED, [GOOD, OTHER, FAILED])
    assert [row.cells for row in rows] == [
        ["extractors", "stopped", "2", "1 of 2", "0", "2.0"],
        ["tracker", "killed", "1", "0 of 1", "1", "–"],
        ["mapper", "killed", "2", "1 of 2", "0", "3.0"],
        ["all", "", "5", "1 of 3", "1", "3.0"],
    ]
    assert [row.is_good for row in make_rows(UNDISTURBED, [GOOD, GOOD])] == [True, True, True]


def test_sentences_name_the_runs_that_differ() -> None:
    assert headline(UNDISTURBED, [GOOD, OTHER, FAILED]) == [
        "1 of 3 runs with 5 faults ended with the undisturbed trajectory and map.",
        "Without faults, the longest pause between two poses was 0.4 s.",
        "Run 2 has another trajectory or map.",
        "Run 3 did not end well: tracker was killed.",
    ]


def test_the_terminal_shows_the_table_in_80_columns(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(make_rows(UNDISTURBED, [GOOD, OTHER, FAILED]))
    out = capsys.readouterr().out
    assert "[s]" in out and "0 of 1 ✗" in out and "…" not in out
    assert all(len(line) <= 80 for line in out.splitlines())


def test_each_fault_is_a_row_of_the_csv_file() -> None:
    rows = list(csv.DictReader(io.StringIO(as_csv(UNDISTURBED, [GOOD, FAILED]))))
    assert [(row["run"], row["process"], row["pause_s"]) for row in rows] == [
        ("1", "mapper", "3.000"),
        ("1", "extractor_0", "0.500"),
        ("2", "mapper", "1.500"),
        ("2", "tracker", ""),
    ]
    assert [run["is_like_undisturbed"] for run in as_json(UNDISTURBED, [GOOD, FAILED])["runs"]] == [True, False]


def test_the_page_has_sentences_table_and_picture(tmp_path: Path) -> None:
    write_faults_page(tmp_path / "faults.html", "street <b> mono", UNDISTURBED, [GOOD, FAILED])
    page = Page(tmp_path / "faults.html")
    words = " ".join(page.root.words().split())
    for expected in ("Faults: street <b> mono", "1 of 2 runs with 4 faults", "tracker was killed.", "0 of 1"):
        assert expected in words, expected
    [svg] = [svg for figure in page.root.all("figure") for svg in figure.all("svg")]
    assert "killed: at most 3.0 s" in svg.attributes["aria-label"]
