"""The way of frames through the processes, from the times in a recorded log."""

from pathlib import Path

import pytest

from helpers.recorded_log import (
    CAMERA_MS,
    CAMERA_STEP_MS,
    CANDIDATES_MS,
    DELTA_MS,
    DISPATCHER_STEP_MS,
    FEATURES_MS,
    JOB_MS,
    KEYFRAME_MS,
    LOOP_MS,
    POSE_MS,
    write_log,
)
from tessera_cli.experiments.events import Event, read_events, read_log, write_events
from tessera_cli.experiments.gantt import draw_gantt
from tessera_cli.experiments.timeline import Step, busy_shares, reconstruct, row_order, typical_frame


@pytest.fixture
def events(tmp_path: Path) -> list[Event]:
    return read_log(write_log(tmp_path / "run.lcmlog"))


@pytest.fixture
def steps(events: list[Event]) -> dict[tuple[str, int], tuple[float, float, float]]:
    """(ready, began, ended) in ms, by process and frame."""
    return {
        (step.process, step.frame): (step.ready_us / 1000, step.began_us / 1000, step.ended_us / 1000)
        for step in reconstruct(events, loop_delay_keyframes=6)
    }


def test_a_value_in_two_messages_counts_once(events: list[Event]) -> None:
    assert [event.utime_us for event in events if event.channel == "CAMERA"] == [1000 * time for time in CAMERA_MS]


def test_what_answers_a_keyframe_belongs_to_its_frame(events: list[Event]) -> None:
    assert {event.channel: event.frame for event in events if event.channel in ("MAP_DELTA", "LOOP_RESULT")} == {
        "MAP_DELTA": 0,
        "LOOP_RESULT": 0,
    }


def test_events_are_kept_when_the_log_is_gone(events: list[Event], tmp_path: Path) -> None:
    write_events(events, tmp_path / "events.csv")
    assert read_events(tmp_path / "events.csv") == events


def test_camera_and_dispatcher_have_their_mean_step(steps: dict) -> None:
    assert steps["camera", 1] == (CAMERA_MS[1] - CAMERA_STEP_MS, CAMERA_MS[1] - CAMERA_STEP_MS, CAMERA_MS[1])
    assert steps["dispatcher", 1] == (CAMERA_MS[1], JOB_MS[1], JOB_MS[1] + DISPATCHER_STEP_MS)


def test_a_free_process_begins_when_its_input_is_sent(steps: dict) -> None:
    assert steps["extractor_0", 0] == (JOB_MS[0], JOB_MS[0], CANDIDATES_MS[0])
    assert steps["extractor_1", 1] == (JOB_MS[1], JOB_MS[1], CANDIDATES_MS[1])
    assert steps["reassembler", 1] == (CANDIDATES_MS[1], CANDIDATES_MS[1], FEATURES_MS[1])
    assert steps["mapper", 0] == (KEYFRAME_MS, KEYFRAME_MS, DELTA_MS)
    assert steps["loop_closer", 0] == (DELTA_MS, DELTA_MS, LOOP_MS)


def test_the_tracker_waits_for_the_delta_that_a_frame_must_see(steps: dict) -> None:
    assert steps["tracker", 0] == (FEATURES_MS[0], FEATURES_MS[0], POSE_MS[0])
    assert steps["tracker", 1] == (FEATURES_MS[1], DELTA_MS, POSE_MS[1])


def keyframe_events(frame: int, sent_ms: float, delta_ms: float, loop_ms: float) -> list[Event]:
    return [
        Event("KEYFRAME", "tracker", int(1000 * sent_ms), frame, frame),
        Event("MAP_DELTA", "mapper", int(1000 * delta_ms), frame, frame),
        Event("LOOP_RESULT", "loop_closer", int(1000 * loop_ms), frame),
    ]


def test_the_mapper_waits_for_the_loop_results_that_are_due() -> None:
    """Of the keyframe before the last one, where they are due two keyframes later."""
    events = [*keyframe_events(0, 0, 10, 55), *keyframe_events(3, 20, 30, 58), *keyframe_events(5, 40, 70, 80)]

    def began_ms(loop_delay_keyframes: int | None) -> float:
        steps = reconstruct(events, loop_delay_keyframes)
        return next(step.began_us for step in steps if (step.process, step.frame) == ("mapper", 5)) / 1000

    assert began_ms(2) == 55
    assert began_ms(3) == 40 == began_ms(None)


def test_a_busy_process_begins_when_its_step_before_is_over() -> None:
    events = [*keyframe_events(0, 0, 50, 60), *keyframe_events(1, 10, 80, 90)]
    mapper = [step for step in reconstruct(events, None) if step.process == "mapper"]
    assert [(step.ready_us, step.began_us, step.ended_us) for step in mapper] == [
        (0, 0, 50_000),
        (10_000, 50_000, 80_000),
    ]


def test_jobs_of_one_frame_are_answered_in_their_order() -> None:
    jobs = [Event("TILE_0", "dispatcher", time, 4) for time in (0, 1000)]
    answers = [Event("TILE_FEATURES", "extractor_0", time, 4) for time in (5000, 9000)]
    steps = [step for step in reconstruct([*jobs, *answers], None) if step.process == "extractor_0"]
    assert [(step.ready_us, step.began_us, step.ended_us) for step in steps] == [(0, 0, 5000), (1000, 5000, 9000)]


def way(frame: int, duration_us: int, is_keyframe: bool = True) -> list[Step]:
    processes = ("camera", "tracker", "mapper") if is_keyframe else ("camera", "tracker")
    return [Step(process, frame, 0, 0, duration_us) for process in processes]


def test_the_frame_that_is_drawn_is_a_typical_keyframe_of_the_second_half() -> None:
    steps = [*way(0, 1), *way(1, 1), *way(2, 1), *way(3, 900), *way(4, 300), *way(5, 500), *way(6, 400, False)]
    assert typical_frame(steps) == 5
    assert typical_frame(way(6, 400, is_keyframe=False)) is None


def test_how_busy_processes_were() -> None:
    steps = [Step("mapper", 0, 0, 0, 60), Step("mapper", 1, 0, 60, 90), Step("camera", 1, 90, 90, 100)]
    assert busy_shares(steps) == {"mapper": 0.9, "camera": 0.1}


def test_rows_follow_the_data() -> None:
    names = {"mapper", "extractor_10", "extractor_2", "camera", "tracker"}
    assert row_order(names) == ["camera", "extractor_2", "extractor_10", "tracker", "mapper"]


def test_the_picture_says_in_words_what_it_shows(events: list[Event]) -> None:
    drawing = draw_gantt("a drive", {"abc": reconstruct(events, loop_delay_keyframes=6)})
    assert drawing and drawing.title.startswith("a drive: ")
    for words in ("abc, frame 0: ", "mapper worked 39.0, until 63.0", "extractor_0 worked 12.0", "loop_closer"):
        assert words in drawing.label, drawing.label
    assert drawing.svg.startswith("<svg") and "mapper" in drawing.svg


def test_without_a_keyframe_there_is_no_picture() -> None:
    assert draw_gantt("a drive", {"abc": []}) is None
