"""What an experiment runs, in which order, and how its folder is continued."""

import json
from pathlib import Path

import pytest

from tessera_cli.errors import UserError
from tessera_cli.experiments.plan import (
    RUNS,
    THAT,
    THIS,
    ExperimentFolder,
    Sequence,
    alternate,
    check_out,
    choose_sequences,
    open_folder,
)
from tessera_cli.experiments.targets import STANDARD

FIRST, SECOND = Sequence("first", "mono", "kitti:/first"), Sequence("second", "stereo", "kitti:/second")


def test_commits_alternate_and_repetitions_go_round() -> None:
    runs = alternate([FIRST, SECOND], [THIS, THAT], 2)
    assert [(run.sequence.name, run.side, run.repetition) for run in runs] == [
        ("first", THIS, 1),
        ("first", THAT, 1),
        ("second", THIS, 1),
        ("second", THAT, 1),
        ("first", THIS, 2),
        ("first", THAT, 2),
        ("second", THIS, 2),
        ("second", THAT, 2),
    ]


def test_one_commit_is_measured_alone() -> None:
    assert [run.side for run in alternate([FIRST], [THIS], 3)] == [THIS] * 3


def test_every_run_has_a_name_and_a_folder_of_its_own(tmp_path: Path) -> None:
    runs = alternate([FIRST, SECOND], [THIS, THAT], 2)
    folder = ExperimentFolder(tmp_path)
    assert len({run.name for run in runs}) == len({folder.run_path(run) for run in runs}) == len(runs)


def test_absent_standard_sequences_are_left_out_with_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "euroc" / "MH_01").mkdir(parents=True)
    chosen, absent = choose_sequences([], STANDARD, tmp_path)
    assert [sequence.source for sequence in chosen] == [f"euroc:{tmp_path / 'euroc' / 'MH_01'}", "sim:street-short"]
    assert len(absent) == 2 and all("left out" in sentence and str(tmp_path) in sentence for sentence in absent)


def test_own_sources_replace_the_standard_ones(tmp_path: Path) -> None:
    chosen, absent = choose_sequences([("mono", "sim:room,seed=3"), ("rgbd", f"tum:{tmp_path}")], STANDARD, tmp_path)
    assert [(sequence.sensor, sequence.source) for sequence in chosen] == [
        ("mono", "sim:room,seed=3"),
        ("rgbd", f"tum:{tmp_path}"),
    ]
    assert not absent and all(sequence.max_error_m is None for sequence in chosen)


@pytest.mark.parametrize(
    "specs, word",
    [
        ([("mono", "kitti:/no/such/folder")], "/no/such/folder"),
        ([("mono", "camera:0")], "no end"),
        ([("mono", "bus:")], "no end"),
        ([("mono", "sim:room"), ("mono", "sim:room")], "twice"),
    ],
)
def test_sources_at_fault(specs: list[tuple[str, str]], word: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=word):
        choose_sequences(specs, STANDARD, tmp_path)


DESCRIPTION = {"experiment": "performance", "frames": [0, -1]}


def begin(path: Path) -> None:
    folder, continues = open_folder(str(path), "name", DESCRIPTION, force=False)
    assert not continues
    folder.begin(DESCRIPTION)


def write_summary(folder: ExperimentFolder, ended: str) -> None:
    path = folder.run_path(alternate([FIRST], [THIS], 1)[0])
    path.mkdir(parents=True)
    (path / "summary.json").write_text(json.dumps({"ended": ended, "frames": 3}))


def test_an_experiment_of_the_same_description_is_continued(tmp_path: Path) -> None:
    begin(tmp_path / "out")
    write_summary(ExperimentFolder(tmp_path / "out"), "complete")
    folder, continues = open_folder(str(tmp_path / "out"), "name", DESCRIPTION, force=False)
    assert continues
    assert folder.summary(alternate([FIRST], [THIS], 1)[0]) == {"ended": "complete", "frames": 3}


def test_an_interrupted_run_is_not_there(tmp_path: Path) -> None:
    write_summary(ExperimentFolder(tmp_path), "interrupted")
    assert ExperimentFolder(tmp_path).summary(alternate([FIRST], [THIS], 1)[0]) is None


def test_another_experiment_is_not_overwritten(tmp_path: Path) -> None:
    begin(tmp_path / "out")
    other = {**DESCRIPTION, "frames": [0, 9]}
    with pytest.raises(UserError, match=r"another frames.*--force"):
        open_folder(str(tmp_path / "out"), "name", other, force=False)
    folder, continues = open_folder(str(tmp_path / "out"), "name", other, force=True)
    assert not continues
    write_summary(folder, "complete")
    folder.begin(other)
    assert not (folder.path / RUNS).exists()
    assert open_folder(str(folder.path), "name", other, force=False)[1]


def test_other_folders_and_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(UserError, match="not empty"):
        check_out(str(tmp_path), force=False)
    with pytest.raises(UserError, match="is a file"):
        check_out(str(tmp_path / "thesis.tex"), force=True)
    folder, _ = open_folder(str(tmp_path), "name", DESCRIPTION, force=True)
    folder.begin(DESCRIPTION)
    assert (tmp_path / "thesis.tex").read_text() == "years of work", "only what an experiment makes is removed"
