"""The table of a comparison: medians, ratios, targets, and its shape on terminals and in files."""

import csv
import io
import json
from decimal import Decimal
from typing import Any

import pytest

from helpers.comparisons import make_comparison, make_measurement
from tessera_cli.experiments.tables import Comparison, Row, as_csv, as_json, print_table
from tessera_cli.experiments.targets import CPU, SPEED, STANDARD, Target


def comparison(**changes: Any) -> Comparison:
    this = [make_measurement(frames_per_s=speed) for speed in (80.0, 70.0, 90.0)]
    that = [make_measurement(frames_per_s=speed, cpu_ms={"mapper": 60.0}) for speed in (41.0, 39.0, 40.0)]
    return make_comparison(this, that, **changes)


def row(rows: list[Row], figure: str) -> Row:
    (found,) = [each for each in rows if each.figure == figure]
    return found


def test_medians_with_their_spread_and_the_ratio() -> None:
    speed = row(comparison().rows(), "frames/s")
    assert speed.this and (speed.this.text, speed.this.spread_text) == ("80.0", "70.0..90.0")
    assert speed.that and speed.that.text == "40.0"
    assert speed.ratio == "2.00x"


def test_targets_are_ratios_to_the_baseline() -> None:
    rows = comparison().rows()
    speed, cpu = row(rows, "frames/s"), row(rows, "CPU ms a frame")
    assert (speed.target, speed.is_met) == (f"≥ {SPEED['mono']}x", True)
    assert (cpu.target, cpu.ratio, cpu.is_met) == (f"≤ {CPU['mono']}x", "0.53x", False)


def test_against_other_commits_there_are_ratios_but_no_targets() -> None:
    speed = row(comparison(against="1" * 40).rows(), "frames/s")
    assert (speed.target, speed.is_met, speed.ratio) == ("", None, "2.00x")


def test_errors_have_targets_where_the_whole_sequence_was_run() -> None:
    assert row(comparison().rows(), "RMS error [m]").is_met is True
    assert row(comparison(is_whole=False).rows(), "RMS error [m]").target == ""


@pytest.mark.parametrize("value, is_met", [(0.66, True), (0.664, True), (0.666, False), (0.1, True)])
def test_a_value_counts_with_the_digits_of_its_target(value: float, is_met: bool) -> None:
    assert Target(Decimal("0.66"), is_lower=False, is_ratio=False).is_met(value) is is_met


def test_every_kind_of_input_has_a_target() -> None:
    assert {sequence.sensor for sequence in STANDARD} == set(SPEED) == set(CPU)


def test_processes_follow_the_data_and_idle_ones_are_left_out() -> None:
    parts = [each.figure for each in comparison().rows() if each.is_part]
    assert parts == ["camera", "extractors", "tracker", "mapper"]


def test_what_nobody_measured_has_no_row() -> None:
    runs = [make_measurement(error_m=None, latency_median_ms=None, latency_p95_ms=None)]
    figures = [each.figure for each in make_comparison(runs, []).rows()]
    assert not any("RMS" in figure or "latency" in figure for figure in figures)


def test_hashes_are_compared_within_a_commit_and_between_both() -> None:
    same = row(comparison().rows(), "trajectory, map")
    assert (same.is_met, same.ratio) == (True, "same")
    other = make_measurement(hashes=("12" * 32, "34" * 32))
    changed = row(make_comparison([make_measurement()] * 2, [other] * 2).rows(), "trajectory, map")
    assert (changed.is_met, changed.ratio) == (True, "changed")
    broken = row(make_comparison([make_measurement(), other], []).rows(), "trajectory, map")
    assert broken.is_met is False and broken.this and broken.this.text == "2 different"


@pytest.mark.parametrize("width", [80, 120])
def test_the_table_fits_its_terminal(width: int, capsys: pytest.CaptureFixture[str]) -> None:
    print_table([comparison(), make_comparison([make_measurement()], [])], width)
    out = capsys.readouterr().out
    assert max(len(line) for line in out.splitlines()) <= width
    assert "…" not in out
    for words in ("a drive mono", "frames/s", "≥ 2.00x", "2.00x", "✓", "✗", "mapper"):
        assert words in out, words
    assert ("(70.0..90.0)" in out) == (width == 120)


def test_one_commit_alone_has_no_columns_for_another(capsys: pytest.CaptureFixture[str]) -> None:
    print_table([make_comparison([make_measurement()], [])], 80)
    assert "that" not in capsys.readouterr().out


def test_csv_and_json_hold_the_same() -> None:
    rows = list(csv.DictReader(io.StringIO(as_csv([comparison()]))))
    speed = next(each for each in rows if each["figure"] == "frames/s")
    assert (speed["this_median"], speed["that_max"], speed["ratio"], speed["is_met"]) == (
        "80.0",
        "41.0",
        "2.00",
        "true",
    )
    assert any(each["figure"] == "CPU ms a frame: mapper" for each in rows)
    (found,) = json.loads(json.dumps(as_json([comparison()])))
    assert [each["figure"] for each in found["rows"]] == [
        each["figure"].removeprefix("CPU ms a frame: ") for each in rows
    ]
    assert [run["frames_per_s"] for run in found["this"]] == [80.0, 70.0, 90.0]
