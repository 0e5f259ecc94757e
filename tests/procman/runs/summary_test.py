"""What the summary of a run warns of: doubts about the scale, frames that were dropped, poses that came late."""

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tessera_cli.messages import stage_status_t
from tessera_cli.runs.run_folder import Frames, Result, read_log_warnings, read_source_events
from tessera_cli.runs.summary import (
    agreement_warnings,
    drop_warnings,
    focal_warnings,
    is_trustworthy,
    judge_end,
    latency_warnings,
    mending_warnings,
    occupancy_sha256,
    occupancy_warnings,
    recording_warnings,
    right_image_warnings,
    scale_doubts,
    scale_warnings,
    why_nothing_was_located,
)
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


def test_a_run_that_lacks_a_file_or_doubts_its_scale_is_not_to_be_trusted() -> None:
    assert is_trustworthy({"not_written": [], "doubts": []})
    assert not is_trustworthy({"not_written": ["map.ply can't be written"], "doubts": []})
    doubts = scale_doubts(_frames(400, [10], {250: 0.4}))
    assert not is_trustworthy({"not_written": [], "doubts": doubts})
    assert len(doubts) == 1 and "at frame 250" in doubts[0], "a contradiction alone is none"
    assert scale_doubts(None) == []


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


def test_many_doubts_are_counted() -> None:
    sentences = scale_warnings(_frames(1000, list(range(50, 1000, 100))), "mono")
    assert len(sentences) == 6
    assert sentences[-1].startswith("There were 5 more such doubts, the last at frame 950: ")


def test_complete_means_that_every_frame_is_accounted_for() -> None:
    assert judge_end("complete", {"frames": 60, "frames_missing": 0}) == "complete"
    assert judge_end("complete", {"frames": 59, "frames_missing": 1}) == (
        "incomplete: 1 frame is not accounted for, of 60 that the camera sent"
    )
    assert "40 frames are not" in judge_end("complete", {"frames": 20, "frames_missing": 40})
    assert judge_end("interrupted", {"frames": 20, "frames_missing": 40}) == "interrupted"


def test_a_run_whose_points_do_not_agree_with_its_poses_says_what_may_be_wrong() -> None:
    matches = np.concatenate([[np.nan, 0.0], np.full(98, 500.0)])
    frames = replace(_frames(100, []), matches=matches, inliers=0.9 * matches)
    assert agreement_warnings(frames, "stereo") == [] and agreement_warnings(None, "mono") == []
    poor = replace(frames, inliers=0.7 * matches)
    (sentence,) = agreement_warnings(poor, "stereo")
    assert "at most 70 %" in sentence and "same moment" in sentence and "calibration" in sentence
    (sentence,) = agreement_warnings(poor, "mono")
    assert "same moment" not in sentence and "depths" not in sentence
    some = np.where(np.arange(100) < 40, 0.5, 0.9)
    assert agreement_warnings(replace(frames, inliers=some * matches), "mono") == [], "a hard stretch is none"
    few = replace(poor, matches=np.where(np.arange(100) < 20, matches, 0.0))
    assert agreement_warnings(few, "mono") == []


def test_focal_lengths_that_no_calibration_explains_are_a_warning() -> None:
    assert focal_warnings({}) == focal_warnings({"stage_values": {"mapper": {"focal_doubt": 0.0}}}) == []
    (sentence,) = focal_warnings({"stage_values": {"mapper": {"focal_doubt": -0.046}}})
    assert "4.6 % shorter" in sentence and "not used" in sentence


def test_what_the_right_image_was_moved_by_is_told() -> None:
    assert right_image_warnings({}) == right_image_warnings({"stage_values": {"mapper": {"right_shift_px": 0.0}}}) == []
    moved = {
        "right_shift_px": -1.25,
        "right_shift_across_px": 0.02,
        "right_shift_down_px": -0.1,
        "right_shift_bend_px": 0.9,
    }
    (sentence,) = right_image_warnings({"stage_values": {"mapper": moved}})
    assert "moved by -1.25 +0.02 x -0.10 y +0.90 x^2 px" in sentence
    assert "calibrate the stereo pair anew" in sentence.lower()
    (sentence,) = right_image_warnings({"stage_values": {"mapper": {"right_shift_doubt_px": 9.5}}})
    assert "9.5 px" in sentence
    assert "too much" in sentence


def test_a_scale_that_was_mended_is_told() -> None:
    assert mending_warnings({}) == mending_warnings({"stage_values": {"mapper": {"scale_mendings": 0.0}}}) == []
    (once,) = mending_warnings({"stage_values": {"mapper": {"scale_mendings": 1.0}}})
    (thrice,) = mending_warnings({"stage_values": {"mapper": {"scale_mendings": 3.0}}})
    assert "mended once" in once and "mended 3 times" in thrice


def _live_result(latency_ms: np.ndarray, source: str = "kitti:/x", newest_wins: bool = True) -> Result:
    """Poses of 161 of 200 frames of a camera at 10 Hz."""
    numbers = np.linspace(0, 200, len(latency_ms)).astype(int)
    frames = _frames(len(latency_ms), [])
    pose_time_ms = np.concatenate([[np.nan], 100.0 * np.diff(numbers)])
    settings: dict[str, dict[str, Any]] = {
        "camera": {"source": source, "pace": "lockstep"},
        "dispatcher": {"newest_wins": newest_wins},
    }
    return Result(
        name="run",
        estimate=None,
        frames=replace(frames, latency_ms=latency_ms, pose_time_ms=pose_time_ms, numbers=numbers),
        settings=settings,
    )


def test_dropped_frames_are_told_with_what_the_machine_handles() -> None:
    result = _live_result(np.full(161, 50.0))
    assert drop_warnings({"frames": 201, "frames_dropped": 0}, result) == []
    (sentence,) = drop_warnings({"frames": 201, "frames_dropped": 40}, result)
    assert sentence == "Dropped 40 of 201 frames: the machine handles 8.1 frames a second of 10.1."


def test_a_replay_says_that_the_recorded_run_dropped_them() -> None:
    (sentence,) = drop_warnings({"frames": 201, "frames_dropped": 40}, _live_result(np.full(161, 50.0), "log:/x"))
    assert "recorded" in sentence and "handles" not in sentence


def test_late_poses_of_a_live_run_are_told() -> None:
    latency_ms = np.full(161, 50.0)
    assert latency_warnings(_live_result(latency_ms)) == []
    latency_ms[100:103] = [301.0, 950.0, 400.0]
    (sentence,) = latency_warnings(_live_result(latency_ms))
    assert sentence.startswith("3 of 161 poses came later than 3 frame intervals (300 ms)")
    assert "950 ms" in sentence
    assert latency_warnings(_live_result(latency_ms, newest_wins=False)) == []


def test_every_event_of_a_live_source_is_told_in_order(tmp_path: Path) -> None:
    (tmp_path / "camera.log").write_text(
        "20:00:09.000 camera warning: the connection to the camera broke off (it ended); it is opened again\n"
        "20:00:13.500 camera warning: the camera is connected again\n"
        "20:00:14.000 camera warning: the disk is slow\n"
    )
    (tmp_path / "dispatcher.log").write_text(
        "20:00:00.000 dispatcher info: tessera-dispatcher 1.0.0\n"
        "20:00:11.000 dispatcher warning: no image for 2.0 s: the run waits for the source\n"
        "20:00:13.700 dispatcher warning: images come again, after 4.7 s of silence\n"
    )
    events = read_source_events(tmp_path)
    assert [event.split()[0] for event in events] == [
        "20:00:09.000:",
        "20:00:11.000:",
        "20:00:13.500:",
        "20:00:13.700:",
    ]
    assert events[-1] == "20:00:13.700: images come again, after 4.7 s of silence."
    assert read_log_warnings(tmp_path) == ["camera reported 1 problem, the first: the disk is slow"]


def test_events_after_midnight_come_after_those_before(tmp_path: Path) -> None:
    (tmp_path / "camera.log").write_text(
        "23:59:50.000 camera info: tessera-camera 1.0.0\n00:00:01.000 camera warning: the camera is connected again\n"
    )
    (tmp_path / "dispatcher.log").write_text(
        "23:59:51.000 dispatcher info: tessera-dispatcher 1.0.0\n"
        "23:59:58.000 dispatcher warning: no image for 2.0 s: the run waits for the source\n"
        "00:00:02.000 dispatcher warning: images come again, after 4.7 s of silence\n"
    )
    hours = [event[:8] for event in read_source_events(tmp_path)]
    assert hours == ["23:59:58", "00:00:01", "00:00:02"]


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


def test_a_recording_with_gaps_is_told() -> None:
    report = _report("recorder", FINISHED)
    assert recording_warnings(None) == [] and recording_warnings(report) == []
    (lacks,) = recording_warnings(replace(report, lost=761))
    assert "lacks 761 messages" in lacks and "tessera log gaps run.lcmlog" in lacks


def test_a_run_ends_when_all_that_write_its_files_have() -> None:
    progress, is_finished = Progress(), []
    for name, state in (("evaluator", FINISHED), ("occupancy", RUNNING), ("occupancy", FINISHED)):
        progress.add_report(_report(name, state))
        is_finished.append(progress.is_finished)
    assert is_finished == [True, False, True]
    assert not Progress().is_finished


def test_a_run_without_a_pose_says_what_to_look_at() -> None:
    said = {
        sensor: why_nothing_was_located({"frames": 9, "sensor": sensor}, in_a_map=False)
        for sensor in ("mono", "stereo", "rgbd")
    }
    assert all(sentence.startswith("no pose was found for any of 9 frames: ") for sentence in said.values())
    assert "exchanged" in said["stereo"] and "depth images" in said["rgbd"] and "moving" in said["mono"]
    assert "map of this place" in why_nothing_was_located({"frames": 9, "sensor": "stereo"}, in_a_map=True)
