"""tessera log info, gaps, cut, filter and export on a made log: what they say, and what they write."""

import json
from pathlib import Path

import pytest

from helpers.recorded_log import message_of
from helpers.stack import Tessera
from tessera_cli.lcm_bus import LoggedEvent, read_log, write_log

NUM_FRAMES = 20
PERIOD_US = 100_000
BEGAN_US = 1_700_000_000_000_000


def camera_event(frame: int) -> LoggedEvent:
    message = message_of("camera_image_t", frame=frame)
    message.header.publisher, message.header.epoch_us, message.header.sequence = "camera", 5, frame
    return LoggedEvent(BEGAN_US + PERIOD_US * frame, "CAMERA", message.encode())


@pytest.fixture
def events() -> list[LoggedEvent]:
    """A calibration, frames, a pose of each, and something that is none of ours."""
    calibration = message_of("calibration_t")
    calibration.header.publisher = "camera"
    events = [LoggedEvent(BEGAN_US, "CALIBRATION", calibration.encode())]
    for frame in range(NUM_FRAMES):
        pose = message_of("pose_t", frame=frame)
        pose.header.publisher, pose.header.sequence = "tracker", frame
        events += [camera_event(frame), LoggedEvent(BEGAN_US + PERIOD_US * frame + 50, "POSE", pose.encode())]
    return [*events, LoggedEvent(events[-1].time_us, "OTHER\x1b[2J", b"what we don't know")]


@pytest.fixture
def log(tmp_path: Path, events: list[LoggedEvent]) -> Path:
    write_log(tmp_path / "a.lcmlog", events)
    return tmp_path / "a.lcmlog"


def test_a_log_comes_back_as_it_was_written(log: Path, events: list[LoggedEvent]) -> None:
    assert list(read_log(log)) == events


def test_info(tessera: Tessera, log: Path) -> None:
    lines = tessera.command("log", "info", log).must_end_well().out.splitlines()
    assert "42 messages on 4 channels, 1.900 s, " in lines[0]
    rows = {line.split()[0]: line.split() for line in lines[2:]}
    assert rows["CAMERA"][1:3] == ["20", "10.5"]
    assert rows["CAMERA"][4:] == ["camera_image_t,", "camera"]
    assert rows["POSE"][4:] == ["pose_t,", "tracker"]
    assert rows[r"OTHER\x1b[2J"][4:] == ["?"]


def test_gaps_of_a_whole_log(tessera: Tessera, log: Path) -> None:
    finished = tessera.command("log", "gaps", log)
    assert finished.status == 0 and finished.out == f"{log}: 0 messages are missing in 3 streams\n"


def test_gaps(tessera: Tessera, log: Path, events: list[LoggedEvent]) -> None:
    """Messages 3 and 7 to 9 are lost, number 12 comes twice, and 15 behind 16."""
    lost = [camera_event(frame).data for frame in (3, 7, 8, 9)]
    left = [event for event in events if event.data not in lost]
    left.insert(left.index(camera_event(12)), camera_event(12))
    first, second = left.index(camera_event(15)), left.index(camera_event(16))
    left[first], left[second] = left[second], left[first]
    write_log(log, left)
    finished = tessera.command("log", "gaps", log)
    assert finished.status == 1 and finished.out.splitlines() == [
        "CAMERA of camera: 4 of 20 messages are missing: 3 (before 0.400 s), 7 to 9 (before 1.000 s); "
        "1 came again; 1 came out of order",
        f"{log}: 4 messages are missing in 3 streams",
    ]


def test_cut_keeps_the_calibration(tessera: Tessera, log: Path, tmp_path: Path) -> None:
    out = tmp_path / "b.lcmlog"
    said = tessera.command("log", "cut", log, out, "--from", 0.5, "--to", 0.8).must_end_well().out
    assert said == f"7 of 42 messages are in {out}\n"
    assert [event.channel for event in read_log(out)] == ["CALIBRATION", *["CAMERA", "POSE"] * 3]
    assert list(read_log(out))[1] == camera_event(5)


@pytest.mark.parametrize(
    "options, channels", [(("C*",), {"CAMERA", "CALIBRATION"}), (("C*", "OTHER*", "--without"), {"POSE"})]
)
def test_filter(tessera: Tessera, log: Path, tmp_path: Path, options: tuple[str, ...], channels: set[str]) -> None:
    tessera.command("log", "filter", log, tmp_path / "b.lcmlog", *options).must_end_well()
    assert {event.channel for event in read_log(tmp_path / "b.lcmlog")} == channels


def test_export(tessera: Tessera, log: Path, tmp_path: Path) -> None:
    out = tessera.command("log", "export", log, tmp_path / "tables").must_end_well().out
    assert "41 messages of 3 channels" in out and "1 messages are of no type of Tessera's" in out
    rows = [json.loads(line) for line in (tmp_path / "tables" / "POSE.jsonl").read_text().splitlines()]
    assert [row["frame"] for row in rows] == list(range(NUM_FRAMES))
    assert rows[3]["time_us"] == BEGAN_US + 3 * PERIOD_US + 50
    assert rows[3]["header"]["publisher"] == "tracker"


def test_what_is_wrong_is_told(tessera: Tessera, log: Path, tmp_path: Path) -> None:
    tessera.command("log", "info", tmp_path / "none").must_refuse("there is no log")
    (tmp_path / "text").write_text("no log at all")
    tessera.command("log", "info", tmp_path / "text").must_refuse("is no LCM log")
    tessera.command("log", "cut", log, log, "--to", 1).must_refuse("name another file")
    tessera.command("log", "cut", log, tmp_path / "b", "--from", 2, "--to", 1).must_refuse("nothing lies between")
    with open(log, "r+b") as file:
        file.truncate(log.stat().st_size - 5)
    finished = tessera.command("log", "gaps", log)
    assert finished.status == 2 and "cut off or damaged behind byte" in finished.err
