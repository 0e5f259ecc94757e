"""The real processes over UDP on a made sequence: every way of running gives the same trajectory, bit for bit."""

import hashlib
import json
import os
import random
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path

import lcm
import pytest

from helpers.stack import (
    NUM_FRAMES,
    ROOT,
    RUN_TIMEOUT_S,
    Finished,
    Tessera,
    pids_of,
    read_line,
    wait_for,
    wait_for_a_pose,
)
from tessera_cli.files import BIN
from tessera_cli.lcm_bus import LoggedEvent, read_log, write_log
from tessera_cli.messages import pose_t, receive_logged

# All poses of the made sequence are known exactly; the room is 14 m wide.
MAX_RMS_ERROR_M = 0.05
SUMMARY_KEYS = {
    "source",
    "sensor",
    "extractors",
    "tiles",
    "frames",
    "frames_tracked",
    "frames_lost",
    "frames_dropped",
    "tracking_failures",
    "relocalizations",
    "keyframes",
    "landmarks",
    "map_parts",
    "parts",
    "loops_closed",
    "rms_error_m",
    "alignment",
    "wall_s",
    "frames_per_s",
    "pose_time_ms",
    "latency_ms",
    "map_wait_ms",
    "stage_ms",
    "cpu_s",
    "max_rss_mb",
    "messages_repaired",
    "messages_lost",
    "trajectory_sha256",
    "map_sha256",
    "occupancy_sha256",
}
LOGPLAYER = ROOT / ".venv" / "bin" / "lcm-logplayer"


def must_equal(finished: Finished, reference: Finished) -> None:
    finished.must_end_well()
    for key in ("frames", "frames_tracked", "frames_dropped", "trajectory_sha256", "map_sha256"):
        assert finished.summary[key] == reference.summary[key], key


def test_a_run_ends_well(reference_run: Finished) -> None:
    summary = reference_run.summary
    assert set(summary) >= SUMMARY_KEYS
    assert summary["frames"] == NUM_FRAMES
    assert summary["frames_dropped"] == summary["frames_lost"] == summary["tracking_failures"] == 0
    assert summary["frames_tracked"] > 0.8 * NUM_FRAMES
    assert summary["map_parts"] == 1
    (part,) = summary["parts"]
    assert part["is_main"]
    assert part["frames"] == summary["frames_tracked"]
    assert part["keyframes"] == summary["keyframes"]
    assert part["last_frame"] == NUM_FRAMES - 1
    assert summary["rms_error_m"] < MAX_RMS_ERROR_M
    assert summary["messages_lost"] == 0
    assert summary["keyframes"] >= 2 and summary["landmarks"] > 100
    assert summary["map_wait_ms"]["max"] >= 0
    for name in ("extractor_0", "reassembler", "tracker", "mapper"):
        assert summary["stage_ms"][name]["median"] > 0
    for name in ("camera", "dispatcher", "extractor_0", "reassembler", "tracker", "mapper", "evaluator"):
        assert summary["cpu_s"][name] > 0 and summary["max_rss_mb"][name] > 0


def test_a_run_leaves_its_files(reference_run: Finished) -> None:
    files = {path.name for path in reference_run.folder.iterdir()}
    assert files >= {
        "trajectory.txt",
        "trajectory_live.txt",
        "trajectory_kitti.txt",
        "keyframes.txt",
        "map.ply",
        "summary.json",
        "trajectory.png",
        "settings.yaml",
        "stages",
    }
    assert not [name for name in files if "unfinished" in name]
    assert len((reference_run.folder / "trajectory_kitti.txt").read_text().splitlines()) == NUM_FRAMES
    num_landmarks = f"element vertex {reference_run.summary['landmarks']}\n"
    assert num_landmarks.encode() in (reference_run.folder / "map.ply").read_bytes()
    assert (reference_run.folder / "trajectory.txt").read_text() != (
        reference_run.folder / "trajectory_live.txt"
    ).read_text()


def test_evaluate_repeats_the_error_of_the_run(tessera: Tessera, reference_run: Finished) -> None:
    finished = tessera.command("evaluate", reference_run.folder).must_end_well()
    assert f"{reference_run.summary['rms_error_m']:.4f} m" in finished.out


def test_cut_and_shared_out_and_listened_to_gives_the_same(
    tessera: Tessera, sequence: Path, reference_run: Finished
) -> None:
    finished = tessera.run(f"kitti:{sequence}", "--extractors", 3, "--tiles", "2x4", "--occupancy")
    must_equal(finished, reference_run)
    assert reference_run.summary["occupancy_sha256"] is None
    tree = (finished.folder / "occupancy.bt").read_bytes()
    assert finished.summary["occupancy_sha256"] == hashlib.sha256(tree).hexdigest()
    # Told when it was done, after the evaluator.
    assert finished.summary["stage_values"]["occupancy"]["keyframes_without_scan"] == 0
    assert {"occupancy.ot", "occupancy.pgm", "occupancy.yaml"} <= {path.name for path in finished.folder.iterdir()}


def test_a_polish_changes_the_map_at_the_end_and_nothing_before(
    tessera: Tessera, sequence: Path, reference_run: Finished
) -> None:
    """Also where loops are not looked for; the made sequence closes none."""
    polished = tessera.run(f"kitti:{sequence}", "--no-loop-closing", "--polish").must_end_well()
    must_equal(tessera.run(f"kitti:{sequence}", "--polish", "--extractors", 1), polished)
    live = "trajectory_live.txt"
    assert (polished.folder / live).read_bytes() == (reference_run.folder / live).read_bytes()
    for key in ("trajectory_sha256", "map_sha256"):
        assert polished.summary[key] != reference_run.summary[key]
    assert polished.summary["keyframes"] == reference_run.summary["keyframes"]
    assert polished.summary["rms_error_m"] < MAX_RMS_ERROR_M


def test_an_extractor_that_is_killed_changes_nothing(tessera: Tessera, sequence: Path, reference_run: Finished) -> None:
    port, folder = tessera.next_port(), tessera.next_folder()
    run = tessera.start(
        "run", f"kitti:{sequence}", "--extractors", 2, "--tiles", "2x2", "--port", port, "--out", folder
    )
    poses = []
    bus = lcm.LCM(f"udpm://239.255.76.67:{port}?ttl=0")
    bus.subscribe("POSE", lambda _channel, data: poses.append(data)).set_queue_capacity(1000)
    wait_for(lambda: (bus.handle_timeout(20), len(poses) > NUM_FRAMES // 3)[1], "poses")
    os.kill(pids_of(folder, "extractor")[0], signal.SIGKILL)
    out, _ = run.communicate(timeout=RUN_TIMEOUT_S)
    assert run.returncode == 0, out
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["extractor_restarts"] == 1, out
    assert "SIGKILL" in summary["warnings"][0]
    assert summary["trajectory_sha256"] == reference_run.summary["trajectory_sha256"]


@pytest.mark.parametrize("stage", ["camera", "dispatcher", "reassembler", "tracker", "mapper", "evaluator"])
def test_a_stage_that_is_killed_changes_nothing(
    tessera: Tessera, sequence: Path, reference_run: Finished, stage: str
) -> None:
    port, folder = tessera.next_port(), tessera.next_folder()
    run = tessera.start(
        "run", f"kitti:{sequence}", "--extractors", 2, "--tiles", "2x2", "--port", port, "--out", folder
    )
    poses = []
    bus = lcm.LCM(f"udpm://239.255.76.67:{port}?ttl=0")
    bus.subscribe("POSE", lambda _channel, data: poses.append(data)).set_queue_capacity(1000)
    wait_for(lambda: (bus.handle_timeout(20), len(poses) > NUM_FRAMES // 3)[1], "poses")
    os.kill(pids_of(folder, stage)[0], signal.SIGKILL)
    out, _ = run.communicate(timeout=RUN_TIMEOUT_S)
    assert run.returncode == 0, out
    summary = json.loads((folder / "summary.json").read_text())
    assert f"{stage} was killed by SIGKILL" in summary["warnings"][0]
    assert summary["messages_lost"] == 0
    for key in ("frames", "frames_tracked", "frames_dropped", "trajectory_sha256", "map_sha256"):
        assert summary[key] == reference_run.summary[key], key


class KilledRun:
    """A run whose stages are killed when it has so many poses. Nobody keeps more than its last messages in memory.

    8 MB are 13 images of the sequence, which are doubled (camera.min_focal_px): more than are on their way.
    """

    def __init__(self, tessera: Tessera, sequence: Path, *options: object, history_bytes: int = 8_000_000) -> None:
        port, self.folder = tessera.next_port(), tessera.next_folder()
        small = ("--set", f"stream.history_bytes={history_bytes}", "--extractors", 1)
        self._run = tessera.start("run", f"kitti:{sequence}", *small, *options, "--port", port, "--out", self.folder)
        self._frames: set[int] = set()
        self._bus = lcm.LCM(f"udpm://239.255.76.67:{port}?ttl=0")
        self._bus.subscribe("POSE", self._on_pose).set_queue_capacity(1000)

    def _on_pose(self, _channel: str, data: bytes) -> None:
        self._frames.add(pose_t.decode(data).frame)

    def kill(self, stage: str, num_poses: int) -> None:
        wait_for(lambda: self._has(num_poses) and pids_of(self.folder, stage), f"{num_poses} poses and {stage}")
        os.kill(pids_of(self.folder, stage)[0], signal.SIGKILL)

    def _has(self, num_poses: int) -> bool:
        assert self._run.poll() is None, self.end()[1]
        self._bus.handle_timeout(20)
        return len(self._frames) >= num_poses

    def end(self) -> tuple[int, str]:
        """The exit status, and what was printed."""
        out, _ = self._run.communicate(timeout=RUN_TIMEOUT_S)
        return self._run.returncode, out


def test_stages_that_are_killed_one_after_the_other_change_nothing(
    tessera: Tessera, sequence: Path, reference_run: Finished
) -> None:
    """The tracker also before it has a map, right after it was started again, and at the end."""
    run = KilledRun(tessera, sequence, "--pace", 0.5)
    kills = {"camera": 8, "loop": 12, "reassembler": 14, "mapper": 20, "global": 24, "dispatcher": 28, "evaluator": 30}
    kills_of_tracker = [("tracker", num_poses) for num_poses in (0, 3, 16, 31, NUM_FRAMES - 10)]
    kills_in_order = sorted([*kills.items(), *kills_of_tracker], key=lambda kill: kill[1])
    for stage, num_poses in kills_in_order:
        run.kill(stage, num_poses)
    status, out = run.end()
    assert status == 0, out
    summary = json.loads((run.folder / "summary.json").read_text())
    assert len(summary["warnings"]) == len(kills_in_order), out
    for key in ("ended", "frames", "frames_tracked", "frames_dropped", "trajectory_sha256", "map_sha256"):
        assert summary[key] == reference_run.summary[key], key
    assert not (run.folder / "journal").exists()


def test_killed_stages_of_a_lasting_map_begin_with_what_it_was_then(
    tessera: Tessera, sequence: Path, tmp_path: Path
) -> None:
    """The map is saved all the time, and is another one when a stage is started again."""
    lasting = tmp_path / "home.tessera"
    tessera.run(f"kitti:{sequence}", "--map", lasting, "--frames", "0:30").must_end_well()
    saved = lasting.read_bytes()
    undisturbed = tessera.run(f"kitti:{sequence}", "--load-map", lasting).must_end_well()
    run = KilledRun(tessera, sequence, "--map", lasting, "--pace", 0.5, "--set", "evaluator.save_period_s=0.2")
    for number, stage in enumerate(("mapper", "tracker", "evaluator", "loop", "mapper")):
        run.kill(stage, 38 + 4 * number)
        assert lasting.read_bytes() != saved
    status, out = run.end()
    assert status == 0, out
    summary = json.loads((run.folder / "summary.json").read_text())
    for key in ("frames", "frames_tracked", "trajectory_sha256", "map_sha256"):
        assert summary[key] == undisturbed.summary[key], key
    assert (run.folder / "loaded.tessera").read_bytes() == saved


def test_a_recorder_that_is_killed_continues_its_log(tessera: Tessera, sequence: Path, reference_run: Finished) -> None:
    """Also right after it was started again, and at the end."""
    run = KilledRun(tessera, sequence, "--record", "--pace", 0.5, history_bytes=64_000_000)
    kills = (0, 10, 12, NUM_FRAMES - 5)
    for num_poses in kills:
        run.kill("recorder", num_poses)
    status, out = run.end()
    assert status == 0, out
    summary = json.loads((run.folder / "summary.json").read_text())
    assert [text for text in summary["warnings"] if "recorder was killed by SIGKILL" in text] == summary["warnings"]
    assert len(summary["warnings"]) == len(kills) and summary["messages_lost"] == 0, out
    assert not list(run.folder.glob("*.part*"))
    gaps = tessera.command("log", "gaps", run.folder / "run.lcmlog").out.splitlines()
    assert "messages are missing in" in gaps[-1]
    assert not [line for line in gaps[:-1] if not line.startswith(("STATUS ", "EXTRACTOR_READY "))], gaps
    must_equal(tessera.run(run.folder / "run.lcmlog", "--extractors", 2, command="replay"), reference_run)


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ("stream.journal_mb=1", "can't continue where it was killed: its journal had been given up"),
        ("stream.journal_dir=", "tracker was killed by SIGKILL"),
    ],
)
def test_a_tracker_that_is_killed_without_its_journal_ends_the_run(
    tessera: Tessera, sequence: Path, setting: str, sentence: str
) -> None:
    run = KilledRun(tessera, sequence, "--set", setting, "--pace", 0.5)
    run.kill("tracker", NUM_FRAMES // 3)
    status, out = run.end()
    assert status == 1, out
    assert sentence in out
    assert not pids_of(run.folder)


def test_a_mapper_of_lowest_priority_changes_nothing(tessera: Tessera, sequence: Path, reference_run: Finished) -> None:
    port, folder = tessera.next_port(), tessera.next_folder()
    run = tessera.start("run", f"kitti:{sequence}", "--extractors", 2, "--port", port, "--out", folder)
    wait_for(lambda: pids_of(folder, "mapper"), "the mapper")
    os.setpriority(os.PRIO_PROCESS, pids_of(folder, "mapper")[0], 19)
    out, _ = run.communicate(timeout=RUN_TIMEOUT_S)
    assert run.returncode == 0, out
    summary = json.loads((folder / "summary.json").read_text())
    for key in ("trajectory_sha256", "map_sha256"):
        assert summary[key] == reference_run.summary[key], key


def test_the_map_of_a_running_stack_is_the_mappers(
    tessera: Tessera, sequence: Path, reference_run: Finished, tmp_path: Path
) -> None:
    """A listener that joins in the middle reaches the hash of the owner, and says it."""
    port, folder = tessera.next_port(), tessera.next_folder()
    run = tessera.start("run", f"kitti:{sequence}", "--pace", "0.2", "--port", port, "--out", folder)
    poses = []
    bus = lcm.LCM(f"udpm://239.255.76.67:{port}?ttl=0")
    bus.subscribe("POSE", lambda _channel, data: poses.append(data)).set_queue_capacity(1000)
    wait_for(lambda: (bus.handle_timeout(20), len(poses) > NUM_FRAMES // 4)[1], "poses")
    followed = tessera.start("map", tmp_path / "whole.ply", "--follow", "--port", port)
    now = tessera.command("map", tmp_path / "now.ply", "--port", port).must_end_well()
    assert "as the mapper's" in now.out
    assert (tmp_path / "now.ply").read_bytes().startswith(b"ply\n")
    out, _ = followed.communicate(timeout=RUN_TIMEOUT_S)
    assert followed.returncode == 0, out
    run_out, _ = run.communicate(timeout=RUN_TIMEOUT_S)
    assert run.returncode == 0, run_out
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["map_sha256"] == reference_run.summary["map_sha256"]
    assert summary["map_sha256"] in out
    assert (tmp_path / "whole.ply").read_bytes() == (folder / "map.ply").read_bytes()


def test_map_without_a_stack_is_refused(tessera: Tessera, tmp_path: Path) -> None:
    finished = tessera.command("map", tmp_path / "none.ply", "--port", tessera.next_port())
    assert finished.status == 2, finished.out + finished.err
    assert "--port" in finished.err and finished.err.count("\n") == 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_writes_what_it_has(tessera: Tessera, sequence: Path, number: signal.Signals) -> None:
    port, folder = tessera.next_port(), tessera.next_folder()
    run = tessera.start("run", f"kitti:{sequence}", "--pace", "0.5", "--port", port, "--out", folder)
    while " tracked, " not in (line := read_line(run)):
        assert line, "the run ended by itself"
    run.send_signal(number)
    out, _ = run.communicate(timeout=RUN_TIMEOUT_S)
    assert run.returncode == 1, out
    assert json.loads((folder / "summary.json").read_text())["ended"] == "interrupted"
    assert not pids_of(folder)


def test_a_camera_that_is_held_opens_nothing_before_its_input_ends(tessera: Tessera) -> None:
    url = f"bus.main_url=udpm://239.255.76.67:{tessera.next_port()}?ttl=0"
    line = [str(BIN / "tessera-camera"), "--held", "--set", "camera.source=kitti:/no/such/folder", "--set", url]
    camera = subprocess.Popen(line, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert camera.stdin is not None and camera.stderr is not None
    assert "tessera-camera" in camera.stderr.readline()
    time.sleep(0.5)
    assert camera.poll() is None
    camera.stdin.close()
    assert "/no/such/folder" in camera.stderr.read() and camera.wait(RUN_TIMEOUT_S) == 2


def test_no_stage_outlives_a_killed_launcher(tessera: Tessera, sequence: Path) -> None:
    port, folder = tessera.next_port(), tessera.next_folder()
    run = tessera.start("run", f"kitti:{sequence}", "--pace", "0.1", "--port", port, "--out", folder)
    wait_for_a_pose(port)
    run.kill()
    run.wait()
    wait_for(lambda: not pids_of(folder), "the end of all stages", timeout_s=10)


def test_a_second_stack_on_the_same_port_is_refused(tessera: Tessera, sequence: Path) -> None:
    port, folder = tessera.next_port(), tessera.next_folder()
    first = tessera.start("run", f"kitti:{sequence}", "--pace", "0.1", "--port", port, "--out", folder)
    wait_for_a_pose(port)
    second = tessera.command(
        "run", f"kitti:{sequence}", "--port", port, "--out", tessera.next_folder().with_name("second")
    )
    first.send_signal(signal.SIGTERM)
    out, _ = first.communicate(timeout=RUN_TIMEOUT_S)
    assert "another stack" not in out
    assert second.status == 2, second.out + second.err
    assert "--port" in second.err


def test_a_second_run_into_the_same_folder_is_refused_and_the_first_goes_on(tessera: Tessera, sequence: Path) -> None:
    port, folder = tessera.next_port(), tessera.next_folder()
    first = tessera.start("run", f"kitti:{sequence}", "--port", port, "--out", folder)
    wait_for_a_pose(port)
    second = tessera.command("run", f"kitti:{sequence}", "--port", tessera.next_port(), "--out", folder)
    assert second.status == 2 and f"another run writes into {folder}" in second.err, second.out + second.err
    out, _ = first.communicate(timeout=RUN_TIMEOUT_S)
    assert first.returncode == 0, out


@pytest.fixture(scope="module")
def log(tessera: Tessera, sequence: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    log = tmp_path_factory.mktemp("logs") / "room 1.lcmlog"
    finished = tessera.command("record", f"kitti:{sequence}", log).must_end_well()
    assert f"{NUM_FRAMES} frames" in finished.out
    assert {path.name for path in log.parent.iterdir()} == {log.name, f"{log.name}.checksums"}
    return log


def test_a_recorded_log_is_replayed_to_the_same(tessera: Tessera, log: Path, reference_run: Finished) -> None:
    must_equal(tessera.run(log, "--extractors", 2, command="replay"), reference_run)


def test_stock_lcm_logplayer_feeds_the_stack(tessera: Tessera, log: Path, reference_run: Finished) -> None:
    port, folder = tessera.next_port(), tessera.next_folder()
    run = tessera.start("run", "bus:", "--pace", "lockstep", "--extractors", 2, "--port", port, "--out", folder)
    line = ""
    while "waiting for frames" not in line:
        line = read_line(run)
        assert line, "the stack ended before it was ready"
    subprocess.run(
        [LOGPLAYER, f"--lcm-url=udpm://239.255.76.67:{port}?ttl=0", log],
        check=True,
        capture_output=True,
        timeout=RUN_TIMEOUT_S,
    )
    out, _ = run.communicate(timeout=RUN_TIMEOUT_S)
    assert run.returncode == 0, out
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["frames_dropped"] == 0
    assert summary["trajectory_sha256"] == reference_run.summary["trajectory_sha256"]


def test_a_log_cut_in_the_middle_is_refused(tessera: Tessera, log: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.lcmlog"
    cut.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    finished = tessera.run(cut, command="replay")
    assert finished.status == 2, finished.out + finished.err
    assert "cut.lcmlog" in finished.err and finished.err.count("\n") == 1


def test_a_log_of_ours_with_a_flipped_bit_is_refused(tessera: Tessera, log: Path, tmp_path: Path) -> None:
    """In the middle of an image, where nothing else would notice it."""
    flipped = tmp_path / "flipped.lcmlog"
    data = bytearray(log.read_bytes())
    data[len(data) // 2] ^= 1
    flipped.write_bytes(data)
    shutil.copy(f"{log}.checksums", f"{flipped}.checksums")
    finished = tessera.run(flipped, command="replay")
    assert finished.status == 2 and "checksum" in finished.err and finished.err.count("\n") == 1, finished.err


def test_a_log_that_lacks_messages_is_used_as_far_as_it_goes(tessera: Tessera, log: Path, tmp_path: Path) -> None:
    """As stock lcm-logger leaves it, which asks for nothing again: here without a band of each of three frames."""
    lost = {10, 11, 40}
    lossy, dropped = tmp_path / "lossy.lcmlog", set[int]()

    def is_kept(event: LoggedEvent) -> bool:
        if event.channel != "CAMERA":
            return True
        message = receive_logged(event.data)
        assert message is not None
        is_lost = message.frame in lost - dropped
        dropped.update({message.frame} if is_lost else ())
        return not is_lost

    write_log(lossy, filter(is_kept, read_log(log)))
    finished = tessera.run(lossy, command="replay").must_end_well()
    assert f"lacks messages: {NUM_FRAMES - 3} of {NUM_FRAMES} frames are whole" in finished.out
    assert finished.summary["frames_tracked"] > 0.8 * NUM_FRAMES


def publish_noise(port: int, generator: random.Random) -> None:
    """A hundred messages of random bytes on every channel of every bus, and datagrams that are no LCM at all."""
    channels = (
        "CAMERA",
        "CALIBRATION",
        "GROUND_TRUTH",
        "END_OF_STREAM",
        "EXTRACTOR_READY",
        "TILE_ACK",
        "TILE_FEATURES",
        "FEATURES",
        "POSE",
        "KEYFRAME",
        "MAP_DELTA",
        "MAP_SNAPSHOT",
        "MAP_REQUEST",
        "STATUS",
        "HEARTBEAT",
        "REPAIR",
        "TILE_0",
        "TILE_1",
        "UNKNOWN",
    )
    buses = [lcm.LCM(f"udpm://239.255.76.67:{port + offset}?ttl=0") for offset in (0, 1, 2, 4, 13, 14)]
    raw = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    for _ in range(100):
        for bus in buses:
            for channel in channels:
                bus.publish(channel, generator.randbytes(generator.choice((0, 1, 8, 60, 1000))))
        raw.sendto(generator.randbytes(200), ("239.255.76.67", port))
        time.sleep(0.005)


def test_random_bytes_on_every_channel_are_counted_and_change_nothing(
    tessera: Tessera, sequence: Path, reference_run: Finished
) -> None:
    port, folder = tessera.next_port(), tessera.next_folder()
    run = tessera.start(
        "run", f"kitti:{sequence}", "--extractors", 2, "--tiles", "2x2", "--port", port, "--out", folder
    )
    wait_for_a_pose(port)
    publish_noise(port, random.Random(1))
    out, _ = run.communicate(timeout=RUN_TIMEOUT_S)
    assert run.returncode == 0, out
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["messages_of_strangers"] > 0 and summary["messages_undecodable"] == 0
    assert summary["trajectory_sha256"] == reference_run.summary["trajectory_sha256"]


def test_stereo_is_the_same_for_every_cut(tessera: Tessera, sequence: Path) -> None:
    whole = tessera.run(f"kitti:{sequence}", "--sensor", "stereo", "--extractors", 1).must_end_well()
    assert whole.summary["frames_tracked"] == NUM_FRAMES
    assert whole.summary["rms_error_m"] < MAX_RMS_ERROR_M
    must_equal(tessera.run(f"kitti:{sequence}", "--sensor", "stereo", "--extractors", 2, "--tiles", "2x2"), whole)


def test_frames_choose_a_part(tessera: Tessera, sequence: Path) -> None:
    finished = tessera.run(f"kitti:{sequence}", "--frames", "0:20").must_end_well()
    assert finished.summary["frames"] == 20


class TestDamagedInput:
    """Each is one sentence and exit status 2."""

    @pytest.fixture
    def damaged(self, sequence: Path, tmp_path: Path) -> Path:
        return Path(shutil.copytree(sequence, tmp_path / "damaged"))

    def must_be_refused(self, tessera: Tessera, folder: Path, word: str) -> None:
        finished = tessera.run(f"kitti:{folder}")
        assert finished.status == 2, finished.out + finished.err
        assert word in finished.err and finished.err.count("\n") == 1, finished.err

    def test_no_calibration(self, tessera: Tessera, damaged: Path) -> None:
        (damaged / "calib.txt").unlink()
        self.must_be_refused(tessera, damaged, "calib.txt")

    def test_malformed_calibration(self, tessera: Tessera, damaged: Path) -> None:
        (damaged / "calib.txt").write_text("P0: 300 zero\n")
        self.must_be_refused(tessera, damaged, "calib.txt")

    def test_too_few_times(self, tessera: Tessera, damaged: Path) -> None:
        (damaged / "times.txt").write_text("0.0\n0.1\n")
        self.must_be_refused(tessera, damaged, "times.txt")

    def test_truncated_image(self, tessera: Tessera, damaged: Path) -> None:
        image = damaged / "image_0" / "000030.pgm"
        image.write_bytes(image.read_bytes()[:1000])
        self.must_be_refused(tessera, damaged, "000030.pgm")

    def test_image_of_another_size(self, tessera: Tessera, damaged: Path) -> None:
        (damaged / "image_0" / "000030.pgm").write_bytes(b"P5 10 10 255\n" + bytes(100))
        self.must_be_refused(tessera, damaged, "000030.pgm")
