"""Live runs: what is dropped and when it is told, cameras that fall silent and come back, and what a run never does."""

import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import lcm
import pytest
from PIL import Image

from helpers.stack import NUM_FRAMES, ROOT, RUN_TIMEOUT_S, Finished, Tessera, pids_of, read_line, wait_for
from helpers.synthetic_sequence import CENTER_PX, FOCAL_PX, HEIGHT_PX, WIDTH_PX

SYSTEM_PYTHON = "/usr/bin/python3"
BINDINGS = "import gi; gi.require_version('GstRtspServer', '1.0'); from gi.repository import GstRtspServer"


def test_a_live_run_is_replayed_as_it_went(tessera: Tessera, sequence: Path) -> None:
    """Nobody waits for the mapper, and frames drop: what came of that depends on the machine, but can be repeated."""
    live = run_with_a_pause(tessera, sequence, "--live", "--record").must_end_well()
    assert live.summary["frames_dropped"] > 0
    assert any(text.startswith(f"Dropped {live.summary['frames_dropped']} of") for text in live.summary["warnings"])
    replayed = tessera.run(
        live.folder / "run.lcmlog", "--extractors", 1, "--tiles", "2x2", command="replay"
    ).must_end_well()
    for key in ("frames", "frames_tracked", "frames_lost", "frames_dropped", "keyframes", "landmarks"):
        assert replayed.summary[key] == live.summary[key], key
    for key in ("trajectory_sha256", "map_sha256"):
        assert replayed.summary[key] == live.summary[key], key
    assert (replayed.folder / "trajectory_live.txt").read_text() == (live.folder / "trajectory_live.txt").read_text()
    tessera.run(live.folder / "run.lcmlog", "--live", command="replay").must_refuse("leave out --live")


def run_with_a_pause(tessera: Tessera, sequence: Path, *options: object) -> Finished:
    """Its only extractor stands still for a moment, so that frames drop however fast the machine is."""
    port, folder = tessera.next_port(), tessera.next_folder()
    run = tessera.start("run", f"kitti:{sequence}", *options, "--extractors", 1, "--port", port, "--out", folder)
    poses = []
    bus = lcm.LCM(f"udpm://239.255.76.67:{port}?ttl=0")
    bus.subscribe("POSE", lambda _channel, data: poses.append(data)).set_queue_capacity(1000)
    wait_for(lambda: (bus.handle_timeout(20), len(poses) > NUM_FRAMES // 3)[1], "poses")
    [extractor] = pids_of(folder, "extractor")
    os.kill(extractor, signal.SIGSTOP)
    time.sleep(0.5)
    os.kill(extractor, signal.SIGCONT)
    out, _ = run.communicate(timeout=RUN_TIMEOUT_S)
    return Finished(run.returncode, out, "", folder)


def test_a_file_is_read_at_its_own_pace(tessera: Tessera, sequence: Path) -> None:
    live = tessera.run(f"kitti:{sequence}", "--live").must_end_well()
    assert live.summary["wall_s"] > 0.05 * (NUM_FRAMES - 1)
    assert live.summary["tracking_failures"] == 0


def test_a_run_that_located_nothing_says_so(tessera: Tessera, sequence: Path, reference_run: Finished) -> None:
    """The map shows the room; the images turned around do not."""
    turned = Path(shutil.copytree(sequence, reference_run.folder.with_name("turned")))
    for path in (turned / "image_0").iterdir():
        Image.open(path).transpose(Image.Transpose.ROTATE_180).point(lambda value: 255 - value).save(path)
    finished = tessera.run(
        f"kitti:{turned}", "--load-map", reference_run.folder / "map.tessera", "--localize-only", "--frames", "0:12"
    )
    assert finished.status == 1, finished.out + finished.err
    assert "no pose was found for any of 12 frames" in finished.err
    assert "Tracking never failed" not in finished.out


def test_what_was_tracked_before_a_damaged_image_is_kept(tessera: Tessera, sequence: Path, tmp_path: Path) -> None:
    damaged = Path(shutil.copytree(sequence, tmp_path / "damaged"))
    image = damaged / "image_0" / f"{NUM_FRAMES - 10:06d}.pgm"
    image.write_bytes(image.read_bytes()[:200])
    finished = tessera.run(f"kitti:{damaged}")
    assert finished.status == 2, finished.out + finished.err
    assert f"{image} can't be decoded" in finished.err
    assert finished.summary["frames_tracked"] > 0
    assert f"what was reached, {finished.summary['frames_tracked']} tracked frames, is in" in finished.out
    assert "can't be decoded" in finished.summary["ended"]


def test_a_folder_in_which_a_run_reached_nothing_is_used_again(
    tessera: Tessera, sequence: Path, tmp_path: Path
) -> None:
    (tmp_path / "settings.yaml").write_text("of a run that was interrupted before its first pose")
    words = (f"kitti:{sequence}", "--frames", "0:10", "--port", tessera.next_port(), "--out", tmp_path)
    tessera.command("run", *words).must_end_well()


def test_a_run_is_not_overwritten(tessera: Tessera, sequence: Path, reference_run: Finished) -> None:
    summary = (reference_run.folder / "summary.json").read_bytes()
    words = ("run", f"kitti:{sequence}", "--frames", "0:10", "--port", tessera.next_port(), "--out")
    tessera.command(*words, reference_run.folder).must_refuse("holds a run already", "--force")
    assert (reference_run.folder / "summary.json").read_bytes() == summary
    copy = Path(shutil.copytree(reference_run.folder, reference_run.folder.with_name("copied run")))
    tessera.command(*words, copy, "--force").must_end_well()
    assert json.loads((copy / "summary.json").read_text())["frames"] == 10


def test_a_log_is_not_overwritten(tessera: Tessera, sequence: Path, tmp_path: Path) -> None:
    log = tmp_path / "a.lcmlog"
    log.write_bytes(b"mine")
    words = ("record", f"kitti:{sequence}", log, "--frames", "0:3")
    tessera.command(*words).must_refuse("is there already", "--force")
    assert log.read_bytes() == b"mine"
    tessera.command(*words, "--force").must_end_well()
    assert log.stat().st_size > 1000


@pytest.mark.parametrize(
    "words", [["--set", "features.no_such_key=1"], ["--camera", "/no/such.yaml"], ["--sensor", "rgbd"]]
)
def test_a_wrong_command_leaves_no_folder(tessera: Tessera, sequence: Path, words: list[str], tmp_path: Path) -> None:
    out = tmp_path / "run"
    finished = tessera.command("run", f"kitti:{sequence}", *words, "--port", tessera.next_port(), "--out", out)
    assert finished.status == 2, finished.out + finished.err
    assert not out.exists()


def test_a_second_run_takes_the_next_free_port(tessera: Tessera, sequence: Path, tmp_path: Path) -> None:
    """Both without --port; whoever else uses the first ones."""
    first = tessera.start("run", f"kitti:{sequence}", "--pace", "0.1", "--out", tmp_path / "first")
    wait_for(lambda: (tmp_path / "first" / "stages" / "tracker.log").exists(), "the first run")
    second = tessera.command("run", f"kitti:{sequence}", "--frames", "0:10", "--out", tmp_path / "second")
    first.send_signal(signal.SIGTERM)
    first.communicate(timeout=RUN_TIMEOUT_S)
    second.must_end_well()
    assert "this run takes --port" in second.out
    assert json.loads((tmp_path / "second" / "summary.json").read_text())["frames"] == 10


class RtspServer:
    """Plays the images of a KITTI folder there and back, at 10 Hz, until it is killed."""

    def __init__(self, sequence: Path, folder: Path, port: int) -> None:
        self.url = f"rtsp://127.0.0.1:{port}/camera"
        self._port = port
        self._pattern = folder / "%06d.jpg"
        images = sorted((sequence / "image_0").iterdir())
        self._number = 2 * len(images) - 2
        for number, path in enumerate(images + images[-2:0:-1]):
            # RTP carries color images only.
            image = Image.open(path).convert("RGB")
            image.save(str(self._pattern) % number, quality=92, subsampling="4:2:0")
        self._process: subprocess.Popen[str] | None = None

    def start(self, rate: int = 10) -> None:
        server = ROOT / "tests" / "helpers" / "rtsp_server.py"
        numbers = [str(number) for number in (self._number, WIDTH_PX, HEIGHT_PX, rate)]
        self._process = subprocess.Popen(
            [SYSTEM_PYTHON, server, str(self._port), str(self._pattern), *numbers], stdout=subprocess.PIPE, text=True
        )
        assert read_line(self._process) == "ready\n"

    def send_signal(self, number: signal.Signals) -> None:
        assert self._process is not None
        self._process.send_signal(number)

    def kill(self) -> None:
        if self._process:
            self._process.kill()
            self._process.wait()


@pytest.fixture
def server(sequence: Path, tmp_path: Path, tessera: Tessera) -> Iterator[RtspServer]:
    if subprocess.run([SYSTEM_PYTHON, "-c", BINDINGS], capture_output=True).returncode != 0:
        pytest.skip("GStreamer's RTSP server is not installed (gir1.2-gst-rtsp-server-1.0, python3-gi)")
    made = RtspServer(sequence, tmp_path, tessera.next_port() + 30)
    yield made
    made.kill()


def test_a_camera_that_stalls_and_dies_is_waited_for(tessera: Tessera, server: RtspServer, tmp_path: Path) -> None:
    camera = tmp_path / "camera.yaml"
    camera.write_text(f"fx_px: {FOCAL_PX}\nfy_px: {FOCAL_PX}\ncx_px: {CENTER_PX[0]}\ncy_px: {CENTER_PX[1]}\n")
    port, out = tessera.next_port(), tmp_path / "run"
    server.start()
    words = ("--camera", camera, "--port", port, "--out", out, "--give-up", "8", "--record", "--extractors", 1)
    run = tessera.start("run", server.url, *words)
    until_told(run, " tracked, ")
    server.send_signal(signal.SIGSTOP)
    time.sleep(4)
    server.send_signal(signal.SIGCONT)
    time.sleep(3)
    server.kill()
    time.sleep(3)
    server.start(rate=15)
    time.sleep(6)
    server.kill()
    told, _ = run.communicate(timeout=RUN_TIMEOUT_S)
    summary = json.loads((out / "summary.json").read_text())
    assert run.returncode == 1, told
    assert "sent no image for 8 s" in summary["ended"]
    assert summary["frames"] - summary["frames_dropped"] > 60
    events = (out / "stages" / "dispatcher.log").read_text() + (out / "stages" / "camera.log").read_text()
    assert events.count("images come again, after") == 2, events
    assert "the connection to the camera broke off" in events
    assert "the camera is connected again" in events
    for words_of_event in ("images come again, after", "is opened again", "is given up"):
        assert any(words_of_event in warning for warning in summary["warnings"]), summary["warnings"]
    times = [float(line.split()[0]) for line in (out / "trajectory.txt").read_text().splitlines() if line[0] != "#"]
    assert abs(times[-1] - time.time()) < 120, "frames carry the clock of the host"
    replayed = tessera.run(out / "run.lcmlog", command="replay").must_end_well()
    for key in ("trajectory_sha256", "map_sha256"):
        assert replayed.summary[key] == summary[key], key


def test_a_v4l2_camera_that_is_unplugged_and_plugged_in_again_is_continued(tessera: Tessera, tmp_path: Path) -> None:
    """OpenCV's V4L2 code and all of ours, over a device that is made up below it (fake_v4l2.c)."""
    library, unplugged = tmp_path / "fake_v4l2.so", tmp_path / "unplugged"
    source = ROOT / "tests" / "helpers" / "fake_v4l2.c"
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl"], check=True)
    camera = tmp_path / "camera.yaml"
    camera.write_text("fx_px: 500\nfy_px: 500\ncx_px: 320\ncy_px: 240\n")
    port, out = tessera.next_port(), tmp_path / "run"
    words = ("--camera", camera, "--port", port, "--out", out, "--give-up", "10", "--extractors", 1)
    faked = {"LD_PRELOAD": str(library), "FAKE_V4L2_UNPLUGGED": str(unplugged)}
    run = tessera.start("run", "camera:0", *words, **faked)
    until_told(run, " tracked, ")
    unplugged.touch()
    until_told(run, "camera silent for")
    unplugged.unlink()
    until_told(run, " tracked, ")
    unplugged.touch()
    told, _ = run.communicate(timeout=RUN_TIMEOUT_S)
    summary = json.loads((out / "summary.json").read_text())
    assert run.returncode == 1, told
    assert "sent no image for 10 s" in summary["ended"]
    for event in (
        "the connection to the camera broke off",
        "images come again, after",
        "the camera is connected again",
    ):
        assert any(event in warning for warning in summary["warnings"]), summary["warnings"]
    rows = [line.split() for line in (out / "trajectory.txt").read_text().splitlines() if line[0] != "#"]
    assert abs(float(rows[-1][0]) - time.time()) < 120, "frames carry the clock of the host, not that of the buffers"


def until_told(run: "subprocess.Popen[str]", words: str) -> None:
    while words not in (line := read_line(run)):
        assert line, "the run ended by itself"
