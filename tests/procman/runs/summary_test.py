"""What the summary of a run says where the scale of the map is in doubt."""

import numpy as np

from tessera_cli.runs.run_folder import Frames
from tessera_cli.runs.summary import judge_end, scale_warnings


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


def test_complete_means_that_every_frame_is_accounted_for() -> None:
    assert judge_end("complete", {"frames": 60, "frames_missing": 0}) == "complete"
    assert judge_end("complete", {"frames": 59, "frames_missing": 1}) == (
        "incomplete: 1 frame is not accounted for, of 60 that the camera sent"
    )
    assert "40 frames are not" in judge_end("complete", {"frames": 20, "frames_missing": 40})
    assert judge_end("interrupted", {"frames": 20, "frames_missing": 40}) == "interrupted"
