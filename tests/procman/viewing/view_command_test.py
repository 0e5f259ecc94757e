"""Where `tessera view` can't show anything it says why, in one sentence."""

import socket
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.made_run import write_run
from tessera_cli.errors import RunError, UserError
from tessera_cli.viewing import viewer_process, window
from tessera_cli.viewing.scene import INLIERS_PLOT, Look, Moment, Picture, Points, PointSeries, Poses, Series
from tessera_cli.viewing.view_run import view_run
from tessera_cli.viewing.viewer_process import LOOPBACK, ViewerProcess
from tessera_cli.viewing.window import add_package as add_for_real
from tessera_cli.viewing.window import open_view


def arguments(run: Path, **changes: Any) -> Namespace:
    return Namespace(**{"run": str(run), "web": True, "web_port": 9090, "save": None, **changes})


@pytest.fixture(autouse=True)
def installs_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """230 MB are only for those who have something to look at."""
    monkeypatch.setattr(window, "add_package", lambda: pytest.fail("the viewer would be installed"))


def test_folders_without_a_map_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="there is no such folder"):
        view_run(arguments(tmp_path / "none"))
    with pytest.raises(UserError, match="holds no map"):
        view_run(arguments(write_run(tmp_path / "run")))


def test_a_view_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="there is no such file"):
        view_run(arguments(tmp_path / "none.rrd"))


def test_a_package_that_cant_be_installed_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    procman = tmp_path / "procman"
    procman.mkdir()
    (procman / "setup.sh").write_text("add_viewer() { echo 'tessera: is this machine online?' >&2; exit 1; }\n")
    monkeypatch.setattr(window, "ROOT", tmp_path)
    with pytest.raises(RunError, match="rerun-sdk"):
        add_for_real()
    assert "online?" in capfd.readouterr().err


@pytest.mark.parametrize("name", ["view.txt", "none/view.rrd", "."])
def test_files_that_cant_be_written_are_refused(tmp_path: Path, name: str) -> None:
    save = str(tmp_path / name)
    with pytest.raises(UserError, match="can't be written"), open_view(arguments(tmp_path, save=save), "a run"):
        pass


def test_a_taken_port_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer_process, "_program", lambda: "true")
    with socket.socket() as other:
        other.bind((LOOPBACK, 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(UserError, match=f"port {port} .* --web-port N"):
            ViewerProcess(port)


def test_a_viewer_that_ends_says_why(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    program = tmp_path / "viewer"
    program.write_text("#!/bin/sh\necho 'Error: no graphics' >&2\nexit 3\n")
    program.chmod(0o755)
    monkeypatch.setattr(viewer_process, "_program", lambda: str(program))
    with pytest.raises(RunError, match=r"window could not be kept open \(Error: no graphics\); --web"):
        ViewerProcess(None).wait_until_it_listens()


def test_a_recording_holds_what_was_shown(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed: procman/tessera view installs it")
    from tessera_cli.viewing.rerun_sink import RerunSink

    sink = RerunSink("made", None, tmp_path / "made.rrd", Look((INLIERS_PLOT,)))
    numbers = np.arange(3)
    sink.show(Series("keypoints/inliers", numbers, 0.1 * numbers, np.array([1.0, 2.0, 3.0])))
    sink.show(Poses("world/camera", numbers, 0.1 * numbers, np.zeros((3, 3)), np.tile([0, 0, 0, 1.0], (3, 1))))
    corners = [np.zeros((2, 2)), np.empty((0, 2)), np.ones((1, 2))]
    sink.show(PointSeries("world/camera/image/new", numbers, 0.1 * numbers, corners, (1, 2, 3), 2.0))
    sink.show(PointSeries("world/camera/image/lost", np.empty(0, int), np.empty(0), [], (1, 2, 3), 2.0))
    sink.show(Points("world/landmarks", np.zeros((5, 3)), (1, 2, 3), 2.0))
    sink.show(Picture("world/camera/image", b"no image", Moment(2, 0.2)))
    sink.arrange(Look((INLIERS_PLOT,), image_size=(640, 480)))
    sink.close()
    data = (tmp_path / "made.rrd").read_bytes()
    assert len(data) > 1000
    assert viewer_process.is_whole(tmp_path / "made.rrd")
    (tmp_path / "cut.rrd").write_bytes(data[:-100])
    assert not viewer_process.is_whole(tmp_path / "cut.rrd")
    for path in (b"landmarks", b"inliers", b"camera"):
        assert path in data
