"""What the summary of a run says where the scale of the map is in doubt, and of its occupancy map."""

import hashlib
from pathlib import Path

import numpy as np

from tessera_cli.messages import stage_status_t
from tessera_cli.runs.run_folder import Frames
from tessera_cli.runs.summary import occupancy_sha256, occupancy_warnings, scale_warnings
from tessera_cli.supervision.progress import FINISHED, RUNNING, Progress, StageReport, to_report


def _frames(num: int, doubtful: list[int], open_scale: dict[int, float] | None = None) -> Frames:
    figures = np.zeros(num)
    scale_sigma = np.zeros(num)
    for number, sigma in (open_scale or {}).items():
        scale_sigma[number] = sigma
    return Frames(
        times_s=0.1 * np.arange(num),
        states=["tracked"] * num,
        pose_time_ms=figures,
        latency_ms=figures,
        map_wait_ms=figures,
        matches=figures,
        inliers=figures,
        landmarks=figures,
        is_keyframe=figures > 0,
        is_step_doubtful=np.isin(np.arange(num), doubtful),
        scale_sigma=scale_sigma,
        numbers=np.arange(num),
    )


def test_nothing_is_said_where_nothing_is_doubtful() -> None:
    assert scale_warnings(None, "mono") == []
    assert scale_warnings(_frames(100, []), "mono") == []


def test_doubtful_frames_near_each_other_are_one_stretch() -> None:
    (sentence,) = scale_warnings(_frames(400, [337, 344, 349]), "mono")
    assert sentence.startswith("The scale may have slipped between frames 337 and 349: ")
    assert "3 times" in sentence


def test_doubts_far_apart_are_told_by_themselves() -> None:
    first, second = scale_warnings(_frames(400, [10, 332]), "mono")
    assert "at frame 10:" in first and "at frame 332:" in second


def test_with_a_baseline_it_is_the_motion_that_is_in_doubt() -> None:
    (sentence,) = scale_warnings(_frames(100, [50, 52]), "stereo")
    assert sentence.startswith("The estimated motion is doubtful between frames 50 and 52: ")


def test_frames_that_leave_the_scale_open_are_a_stretch_with_its_factor() -> None:
    (sentence,) = scale_warnings(_frames(400, [], {100: 0.2, 120: 0.3, 130: 0.7, 140: 0.2}), "mono")
    assert sentence.startswith("The scale may have slipped between frames 120 and 130 by a factor of 2.0 ")


def test_doubts_of_both_kinds_come_in_the_order_of_their_frames() -> None:
    first, second = scale_warnings(_frames(400, [300], {100: 0.5}), "mono")
    assert "at frame 100 by a factor" in first and "at frame 300: the images contradicted" in second


def test_the_occupancy_map_has_a_hash_where_there_is_one(tmp_path: Path) -> None:
    assert occupancy_sha256(tmp_path) is None
    (tmp_path / "occupancy.bt").write_bytes(b"tree")
    assert occupancy_sha256(tmp_path) == hashlib.sha256(b"tree").hexdigest()


def _report(name: str, state: int, num_without_scan: int = 0) -> StageReport:
    status = stage_status_t()
    status.name, status.state = name, state
    status.value_names, status.values = ["keyframes_without_scan"], [float(num_without_scan)]
    return to_report(status)


def test_what_the_occupancy_map_lacks_is_told() -> None:
    assert occupancy_warnings(None) == []
    assert occupancy_warnings(_report("occupancy", FINISHED)) == []
    (lacks,) = occupancy_warnings(_report("occupancy", FINISHED, 3))
    assert "images of 3 keyframes" in lacks
    (unfinished,) = occupancy_warnings(_report("occupancy", RUNNING))
    assert "not finished" in unfinished


def test_a_run_ends_when_all_that_write_its_files_have() -> None:
    progress, is_finished = Progress(), []
    for name, state in (("evaluator", FINISHED), ("occupancy", RUNNING), ("occupancy", FINISHED)):
        progress.add_report(_report(name, state))
        is_finished.append(progress.is_finished)
    assert is_finished == [True, False, True]
    assert not Progress().is_finished
