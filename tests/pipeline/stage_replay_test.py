"""tessera replay --only: a stage alone says what it said in the recorded run; the first difference is named."""

from dataclasses import replace
from pathlib import Path

import pytest

from helpers.recorded_log import message_of
from helpers.stack import Finished, Tessera
from tessera_cli.lcm_bus import LoggedEvent, read_log, write_log
from tessera_cli.messages import receive_logged
from tessera_cli.runs.stage_replay import compare, read_recording


@pytest.fixture(scope="module")
def recorded(tessera: Tessera, sequence: Path) -> Path:
    """The log of a run."""
    run = tessera.run(f"kitti:{sequence}", "--extractors", 1, "--frames", "0:25", "--record").must_end_well()
    return run.folder / "run.lcmlog"


def replay(tessera: Tessera, log: Path, stage: str, *options: str) -> Finished:
    return tessera.command("replay", log, "--only", stage, "--port", tessera.next_port(), *options)


@pytest.mark.parametrize(
    "stage, channels",
    [
        ("extractor_0", ("TILE_FEATURES",)),
        ("tracker", ("KEYFRAME", "25 on POSE")),
        ("mapper", ("MAP_DELTA",)),
        ("loop_closer", ("LOOP_RESULT",)),
    ],
)
def test_what_is_unchanged_says_the_same(
    tessera: Tessera, recorded: Path, stage: str, channels: tuple[str, ...]
) -> None:
    out = replay(tessera, recorded, stage).must_end_well().out
    assert f"{stage} says the same: " in out
    assert all(channel in out for channel in channels), out


@pytest.mark.parametrize(
    "stage, change, words",
    [
        ("tracker", "tracker.keyframe_max_interval_s=0.2", "tracker "),
        ("mapper", "mapper.max_inner_keyframes=2", "mapper differs first in message "),
    ],
)
def test_the_first_message_that_differs_is_named(
    tessera: Tessera, recorded: Path, stage: str, change: str, words: str
) -> None:
    """A changed setting stands for a changed line of code."""
    finished = replay(tessera, recorded, stage, "--set", change)
    assert finished.status == 1 and finished.err == "", finished.out + finished.err
    assert words in finished.out


def test_an_extractor_that_said_something_else_is_noticed(tessera: Tessera, recorded: Path, tmp_path: Path) -> None:
    """Its options come with each job, so here the recording is changed: one score in message 3."""
    events = list(read_log(recorded))
    place = [i for i, event in enumerate(events) if event.channel == "TILE_FEATURES"][3]
    message = receive_logged(events[place].data)
    assert message is not None
    message.score = [*message.score[:5], message.score[5] + 1, *message.score[6:]]
    events[place] = replace(events[place], data=message.encode())
    write_log(tmp_path / "changed.lcmlog", events)
    (tmp_path / "settings.yaml").write_text((recorded.parent / "settings.yaml").read_text())
    finished = replay(tessera, tmp_path / "changed.lcmlog", "extractor_0")
    assert finished.status == 1
    assert "extractor_0 differs first in message 3 on TILE_FEATURES, of " in finished.out
    assert f"score[5] was {message.score[5]} and is {message.score[5] - 1}." in finished.out


def test_without_a_port_the_next_that_is_free_is_taken(tessera: Tessera, recorded: Path) -> None:
    out = tessera.command("replay", recorded, "--only", "extractor_0").must_end_well().out
    assert "extractor_0 says the same: " in out


def test_one_bit_is_a_difference_and_times_of_measuring_are_none() -> None:
    before, after = (message_of("pose_t", frame=7, num_inliers=3) for _ in range(2))
    after.map_wait_us, after.header.utime = 5, 6
    assert compare(before.encode(), after.encode()) == ""
    after.world_from_camera.translation = [0.0, 2.0**-1074, 0.0]
    assert compare(before.encode(), after.encode()) == (
        "of frame 7: world_from_camera.translation[1] was 0.0 and is 5e-324"
    )


def deltas_said(*numbers_and_parts: tuple[int, int]) -> list[LoggedEvent]:
    """By a mapper, one after the other."""
    events = []
    for sequence, (number, part) in enumerate(numbers_and_parts):
        delta = message_of("map_delta_t", number=number)
        delta.header.publisher, delta.header.sequence = "mapper", sequence
        delta.header.part, delta.header.num_parts = part, 2
        events.append(LoggedEvent(sequence, "MAP_DELTA", delta.encode()))
    return events


def test_deltas_that_are_said_again_are_no_difference(tmp_path: Path) -> None:
    """A follower that starts late asks for the map; the mapper then says its last deltas again, in all their parts."""
    events = deltas_said((0, 0), (0, 1), (1, 0), (1, 1), (0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1))
    write_log(tmp_path / "again.lcmlog", events)
    recording = read_recording(tmp_path / "again.lcmlog", "mapper", "")
    assert recording.outputs == {"MAP_DELTA": [event.data for event in events[:4] + events[8:]]}
    assert recording.num_outputs == 6


def test_a_delta_that_does_not_decode_is_compared(tmp_path: Path) -> None:
    events = deltas_said((0, 0), (0, 1), (1, 0))
    cut = replace(events[1], data=events[1].data[:-8])
    assert receive_logged(cut.data) is None
    write_log(tmp_path / "cut.lcmlog", [events[0], cut, events[2]])
    recording = read_recording(tmp_path / "cut.lcmlog", "mapper", "")
    assert recording.outputs == {"MAP_DELTA": [events[0].data, cut.data, events[2].data]}


def test_logs_that_do_not_tell_are_refused(tessera: Tessera, recorded: Path, tmp_path: Path) -> None:
    replay(tessera, recorded, "camera").must_refuse("--only camera", "tracker")
    replay(tessera, tmp_path / "none", "tracker").must_refuse("there is no log")
    replay(tessera, recorded, "extractor_7").must_refuse("has nothing that extractor_7 said")
    poses = [event for event in read_log(recorded) if event.channel == "POSE"]
    write_log(tmp_path / "cut.lcmlog", poses[:5] + poses[6:])
    replay(tessera, tmp_path / "cut.lcmlog", "tracker").must_refuse("lacks message 5 of tracker on POSE")
