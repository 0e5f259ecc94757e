"""tessera evaluate: one or several runs or trajectory files, with and without a report."""

import shutil
from pathlib import Path

import pytest

from helpers.made_run import write_run
from helpers.stack import Tessera


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("evaluated")
    return [write_run(folder / name, seed) for seed, name in enumerate(("one", "two"))]


def test_one_run_in_the_old_words(tessera: Tessera, runs: list[Path]) -> None:
    out = tessera.command("evaluate", runs[0]).must_end_well().out
    assert [line.split()[0] for line in out.splitlines()] == ["poses", "alignment", "RMS", "mean"]
    assert "116 of 116 have a ground truth" in out and "SE(3)" in out


def test_several_runs_in_a_table_and_a_report(tessera: Tessera, runs: list[Path], tmp_path: Path) -> None:
    report = tmp_path / "beside.html"
    out = tessera.command("evaluate", *runs, "--report", report).must_end_well().out
    assert [line.split()[0] for line in out.splitlines()] == ["poses", "one", "two", "report"]
    assert "2 trajectories compared" in report.read_text()
    assert [path.name for path in tmp_path.iterdir()] == [report.name]


def test_files_with_one_truth_for_all(tessera: Tessera, runs: list[Path], tmp_path: Path) -> None:
    truth, report = runs[0] / "ground_truth.txt", tmp_path / "files.html"
    alone = tessera.command("evaluate", runs[0] / "trajectory.txt", truth, "--align", "se3").must_end_well().out
    both = (
        tessera.command(
            "evaluate", *(run / "trajectory.txt" for run in runs), truth, "--align", "se3", "--report", report
        )
        .must_end_well()
        .out
    )
    rms_m = alone.split("RMS error")[1].split()[0]
    assert ["one/trajectory", "116", rms_m] == both.splitlines()[1].split()[:3]
    assert report.is_file()


def test_a_run_without_truth(tessera: Tessera, runs: list[Path], tmp_path: Path) -> None:
    run = Path(shutil.copytree(runs[0], tmp_path / "run"))
    (run / "ground_truth.txt").unlink()
    refused = tessera.command("evaluate", run)
    assert refused.status == 2 and "ground truth" in refused.err and refused.err.count("\n") == 1
    told = tessera.command("evaluate", run, "--report", tmp_path / "report.html").must_end_well()
    assert "not measured" in told.out and (tmp_path / "report.html").is_file()
    given = tessera.command("evaluate", run, runs[0] / "ground_truth.txt").must_end_well()
    assert given.out == tessera.command("evaluate", runs[0]).out


def test_a_report_that_can_not_be_written(tessera: Tessera, runs: list[Path], tmp_path: Path) -> None:
    refused = tessera.command("evaluate", runs[0], "--report", tmp_path / "none" / "report.html")
    assert refused.status == 2 and "--report" in refused.err


def test_damaged_files_of_a_run_are_refused(tessera: Tessera, runs: list[Path], tmp_path: Path) -> None:
    for name, text in (("loops.csv", "a,b\n1,2\n"), ("frames.csv", "frame\n1\n"), ("summary.json", "{")):
        run = Path(shutil.copytree(runs[0], tmp_path / f"bad {name}"))
        (run / name).write_text(text)
        refused = tessera.command("evaluate", run)
        assert refused.status == 2 and name in refused.err and refused.err.count("\n") == 1, refused.err
