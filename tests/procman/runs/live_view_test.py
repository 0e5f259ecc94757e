"""The panel of a run: what it says of the camera, at 80 columns and wider."""

import io
from dataclasses import replace

from rich.console import Console

from tessera_cli.messages import pose_t
from tessera_cli.runs.live_view import RunPanel
from tessera_cli.supervision.progress import FINISHED, RUNNING, Progress, StageReport


def _pose(frame: int, state: int = pose_t.TRACKED, since_tracked_s: float = 0.0) -> pose_t:
    pose = pose_t()
    pose.frame, pose.state, pose.latency = frame, state, 14_000
    pose.since_tracked = int(1e6 * since_tracked_s)
    pose.world_from_camera.translation = [0.1 * frame, 0.0, 0.01 * frame * frame]
    return pose


def _report(name: str, dropped: int = 0, **values: float) -> StageReport:
    return StageReport(name, "host", 1, 0, RUNNING, dropped, 0, 0, 0, 0, 0, 1.0, 5.0, 60.0, "", values, 0.0)


def _progress(num_poses: int = 20) -> Progress:
    progress = Progress(num_frames=200)
    for frame in range(num_poses):
        progress.add_pose(_pose(frame))
    return progress


def _drawn(progress: Progress, width: int) -> str:
    panel = RunPanel("version 1.0.0: kitti-03, mono, 2 extractors, 1x1 tiles")
    panel._live.console = Console(file=io.StringIO(), width=width, force_terminal=True, color_system=None)
    panel._live.console.print(panel._draw(progress))
    file = panel._live.console.file
    assert isinstance(file, io.StringIO)
    return file.getvalue()


def test_it_tells_tracking_latency_and_drops_at_80_columns() -> None:
    progress = _progress()
    progress.add_report(_report("dispatcher", dropped=31))
    progress.add_report(_report("mapper", keyframes=40, landmarks=3000, loops=1))
    drawn = _drawn(progress, 80)
    for words in ("tracked", "latency 14 ms", "dropped 31 of 51", "40 keyframes", "3,000 landmarks", "1 loop"):
        assert words in drawn, drawn
    assert max(len(line) for line in drawn.splitlines()) <= 80


def test_a_wide_terminal_shows_the_path_too() -> None:
    drawn = _drawn(_progress(), 140)
    assert any(0x2800 < ord(character) <= 0x28FF for character in drawn)
    assert not any(0x2800 < ord(character) <= 0x28FF for character in _drawn(_progress(), 80))
    assert len(drawn.splitlines()[0]) == 140


def test_a_camera_without_a_pose_is_searching_and_then_lost() -> None:
    progress = _progress()
    assert progress.state == "tracked"
    progress.add_pose(_pose(20, pose_t.LOST, 0.1))
    assert progress.state == "searching"
    progress.add_pose(_pose(40, pose_t.LOST, 2.1))
    assert progress.state == "lost"


def test_a_silent_camera_is_told_instead() -> None:
    progress = _progress()
    progress.add_report(_report("dispatcher", silent_s=8.2))
    assert "camera silent for 8 s" in _drawn(progress, 80)


def test_the_path_stays_bounded() -> None:
    progress = _progress(10_000)
    assert 500 <= len(progress.path) <= 1000
    assert progress.path[-1][0] > 980


def test_a_camera_without_an_end_has_no_time_left() -> None:
    assert " left" in _drawn(_progress(), 80)
    assert " left" not in _drawn(Progress(num_frames=None), 80)


def test_an_evaluated_run_has_all_its_frames_also_those_whose_poses_were_missed() -> None:
    progress = _progress(180)
    assert "180/200 frames" in _drawn(progress, 80)
    progress.add_report(replace(_report("evaluator"), state=FINISHED))
    drawn = _drawn(progress, 80)
    assert "200/200 frames" in drawn and "0:00 left" in drawn
