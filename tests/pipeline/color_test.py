"""Color through the whole pipeline: the real processes on a made sequence whose walls are painted."""

import csv
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import lcm
import numpy as np
import pytest

from helpers.stack import RUN_TIMEOUT_S, Finished, Tessera, pids_of, wait_for
from helpers.synthetic_sequence import TINTS, make_walls, pose_at, write_sequence
from tessera_cli.maps.landmark_colors import VERTEX
from tessera_cli.maps.occupancy_file import Voxels, read_voxels

NUM_FRAMES = 40
HASHES = ("trajectory_sha256", "map_sha256", "occupancy_sha256")
# A point is on the wall within this distance of it if all other walls are CLEAR_M away.
ON_WALL_M, CLEAR_M = 0.15, 0.5
DARKEST_SUM = 90  # of red, green and blue: the shares of darker colors are rough
MAX_SHARE_ERROR = 0.04  # of each color in their sum; tints differ by 0.1 and more


@pytest.fixture(scope="module")
def painted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_sequence(tmp_path_factory.mktemp("made") / "painted", NUM_FRAMES, with_color=True)


@pytest.fixture(scope="module")
def colored(tessera: Tessera, painted: Path) -> Finished:
    return tessera.run(f"kitti:{painted}", "--sensor", "stereo", "--occupancy").must_end_well()


def share_of_right_colors(points: np.ndarray, colors: np.ndarray) -> float:
    """Of n x 3 points in the world of the first camera, m, with n x 3 bytes: those painted as the wall they are on.

    Points near two walls are left out.
    """
    first = pose_at(0)
    points = points @ first[:, :3].T + first[:, 3]
    distances = np.full((len(points), len(TINTS)), np.inf)
    for number, wall in enumerate(make_walls()):
        others = [axis for axis in range(3) if axis != wall.axis]
        outside = np.maximum(wall.low - points, points - wall.high)[:, others].clip(0)
        beside = points[:, wall.axis] - wall.position_m
        distances[:, number] = np.hypot(np.linalg.norm(outside, axis=1), beside)
    nearest, second = np.sort(distances, axis=1)[:, :2].T
    counts = (nearest < ON_WALL_M) & (second > CLEAR_M) & (colors.sum(axis=1) > DARKEST_SUM)
    assert counts.sum() > 100, "else nothing is shown"
    walls = distances[counts].argmin(axis=1)
    assert len(set(walls)) >= 4, "several colors"
    shares = colors[counts] / colors[counts].sum(axis=1, keepdims=True)
    wanted = TINTS / TINTS.sum(axis=1, keepdims=True)
    return float((abs(shares - wanted[walls]).max(axis=1) < MAX_SHARE_ERROR).mean())


def vertices(path: Path) -> np.ndarray:
    header, _, data = path.read_bytes().partition(b"end_header\n")
    assert b"property uchar red" in header, "it has no colors"
    return np.frombuffer(data, VERTEX)


def voxels_in_color(path: Path) -> tuple[Voxels, np.ndarray]:
    voxels = read_voxels(path)
    assert voxels.colors is not None
    return voxels, voxels.colors


def test_landmarks_and_voxels_have_the_colors_of_the_images(colored: Finished) -> None:
    landmarks = vertices(colored.folder / "map.ply")
    assert share_of_right_colors(landmarks["position"], landmarks["rgb"]) > 0.95
    voxels, colors = voxels_in_color(colored.folder / "occupancy.ot")
    assert share_of_right_colors(voxels.centers, colors) > 0.9


def test_colors_change_no_hash(tessera: Tessera, painted: Path, colored: Finished) -> None:
    """Neither of poses, nor of the map, nor of what is free."""
    gray = tessera.run(
        f"kitti:{painted}", "--sensor", "stereo", "--occupancy", "--extractors", 2, "--set", "camera.color=false"
    ).must_end_well()
    assert b"red" not in (gray.folder / "map.ply").read_bytes().partition(b"end_header")[0]
    for key in HASHES:
        assert gray.summary[key] == colored.summary[key] is not None, key


class Going:
    """A run at a slow pace that is looked at, or disturbed, on its way."""

    def __init__(self, tessera: Tessera, source: Path, pace: float) -> None:
        self.port, self.folder = tessera.next_port(), tessera.next_folder()
        words = ("--sensor", "stereo", "--occupancy", "--pace", pace, "--port", self.port, "--out", self.folder)
        self._process = tessera.start("run", f"kitti:{source}", *words)
        self._num = {"POSE": 0, "GROUND_TRUTH": 0}
        self._bus = lcm.LCM(f"udpm://239.255.76.67:{self.port}?ttl=0")
        for channel in self._num:
            self._bus.subscribe(channel, self._on_message).set_queue_capacity(1000)

    def _on_message(self, channel: str, _data: bytes) -> None:
        self._num[channel] += 1

    def wait_for(self, num: int, channel: str = "POSE") -> None:
        """So many since the start. GROUND_TRUTH: the camera has sent so many frames."""
        wait_for(lambda: (self._bus.handle_timeout(20), self._num[channel] >= num)[1], f"{num} on {channel}")

    def send(self, name: str, number: signal.Signals) -> None:
        os.kill(pids_of(self.folder, name)[0], number)

    def finish(self) -> Finished:
        out, _ = self._process.communicate(timeout=RUN_TIMEOUT_S)
        return Finished(self._process.returncode, out, "", self.folder).must_end_well()

    def end(self) -> None:
        self._process.kill()


@contextmanager
def going(tessera: Tessera, source: Path, pace: float = 0.2) -> Iterator[Going]:
    run = Going(tessera, source, pace)
    try:
        yield run
    finally:
        run.end()


def test_the_map_of_a_running_stack_is_in_color(tessera: Tessera, painted: Path, tmp_path: Path) -> None:
    """Also that of keyframes from before the listener came."""
    with going(tessera, painted, pace=0.1) as run:
        run.wait_for(NUM_FRAMES // 2)
        for name in ("now.ply", "now.ot"):
            tessera.command("map", tmp_path / name, "--port", run.port).must_end_well()
        run.finish()
    landmarks = vertices(tmp_path / "now.ply")
    assert landmarks["observations"].max() > 1, "the map of then, not that of the first keyframe"
    assert share_of_right_colors(landmarks["position"], landmarks["rgb"]) > 0.95
    voxels, colors = voxels_in_color(tmp_path / "now.ot")
    assert share_of_right_colors(voxels.centers, colors) > 0.9


def test_neither_a_killed_occupancy_stage_nor_a_killed_camera_loses_a_color(
    tessera: Tessera, painted: Path, colored: Finished
) -> None:
    with open(colored.folder / "frames.csv", newline="") as file:
        keyframes = [int(row["frame"]) for row in csv.DictReader(file) if row["is_keyframe"] == "1"]
    lost = keyframes[1]
    assert 12 < lost < NUM_FRAMES - 4
    with going(tessera, painted) as run:
        run.wait_for(lost // 4)
        run.send("occupancy", signal.SIGKILL)
        run.wait_for(lost - 4)  # it has asked the camera for what it lacks
        # The camera sends a keyframe, and dies before it hears that it is one.
        run.send("tracker", signal.SIGSTOP)
        run.wait_for(lost + 3, "GROUND_TRUTH")
        run.send("camera", signal.SIGSTOP)
        run.send("tracker", signal.SIGCONT)
        run.wait_for(lost + 1)
        run.send("camera", signal.SIGKILL)
        finished = run.finish()
    killed = [warning for warning in finished.summary["warnings"] if "was killed by SIGKILL" in warning]
    assert len(killed) == 2, "each was started again"
    for key in HASHES:
        assert finished.summary[key] == colored.summary[key], key
    for name in ("map.ply", "occupancy.ot"):
        assert (finished.folder / name).read_bytes() == (colored.folder / name).read_bytes(), name
