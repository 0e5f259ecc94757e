"""What a live run, and the body that carries the camera, mean as settings."""

from pathlib import Path

import pytest

from tessera_cli.cli.main import parse_arguments
from tessera_cli.runs.run_settings import run_assignments
from tessera_cli.runs.sources import parse_source


def _settings(*words: str) -> dict[str, str]:
    arguments = parse_arguments(["run", *words])
    arguments.port = 7667
    assignments = run_assignments(arguments, parse_source(arguments.source), Path("/out"))
    return dict(text.split("=", 1) for text in assignments)


@pytest.mark.parametrize("words", [["camera:0"], ["rtsp://camera/1"], ["bus:"], ["kitti:/tmp", "--live"]])
def test_of_a_live_source_the_newest_frame_wins(words: list[str]) -> None:
    settings = _settings(*words)
    assert settings["camera.pace"] == "realtime"
    assert settings["tracker.live"] == settings["dispatcher.newest_wins"] == "true"
    assert settings["dispatcher.max_frames_in_flight"] == "2"


@pytest.mark.parametrize("words", [["kitti:/tmp"], ["bus:", "--pace", "lockstep"], ["kitti:/tmp", "--pace", "2"]])
def test_of_others_every_frame_counts(words: list[str]) -> None:
    settings = _settings(*words)
    assert not {"tracker.live", "dispatcher.newest_wins", "dispatcher.max_frames_in_flight"} & set(settings)


def test_a_live_run_may_have_another_pace() -> None:
    assert _settings("kitti:/tmp", "--live", "--pace", "3")["camera.pace"] == "3.0"
    assert "dispatcher.newest_wins" not in _settings("kitti:/tmp", "--live", "--pace", "lockstep")


def test_the_camera_is_the_body_unless_axes_or_file_say_more(tmp_path: Path) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text("fx_px: 1\n")
    camera = ["video:/proc/version", "--camera", str(file)]
    assert "body.base_from_camera" not in _settings(*camera)
    assert _settings(*camera, "--axes", "ros")["body.base_from_camera"].startswith("0.0 0.0 1.0 0.0 -1.0")
    file.write_text("base_from_camera: [0, 0, 1, 0.3, -1, 0, 0, 0, 0, -1, 0, 0.12]\n")
    told = "0 0 1 0.3 -1 0 0 0 0 -1 0 0.12"
    assert _settings(*camera)["body.base_from_camera"] == told
    assert _settings(*camera, "--axes", "ros")["body.base_from_camera"] == told
    assert "body.base_from_camera" not in _settings(*camera, "--axes", "camera")


def test_giving_up_is_asked_for() -> None:
    assert "camera.give_up_s" not in _settings("rtsp://camera/1")
    assert _settings("rtsp://camera/1", "--give-up", "8")["camera.give_up_s"] == "8.0"
