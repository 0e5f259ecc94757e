"""Losing the camera and finding it again, and maps that outlive their run: the real processes on a made sequence."""

import csv
import shutil
from pathlib import Path
from typing import Any

import pytest

from helpers.stack import NUM_FRAMES, ROOT, Finished, Tessera, wait_for
from helpers.synthetic_sequence import HEIGHT_PX, WIDTH_PX

BLACK = f"P5 {WIDTH_PX} {HEIGHT_PX} 255\n".encode() + bytes(WIDTH_PX * HEIGHT_PX)
# The lost camera is black for 2 s, long enough for a new part of the map to be begun if nothing were recognized.
NUM_BLACK = 40


def rearrange(sequence: Path, folder: Path, frames: list[int | None]) -> Path:
    """A sequence of these frames of another one; None: a black image."""
    shutil.copytree(sequence, folder, ignore=shutil.ignore_patterns("image_*", "times.txt", "poses.txt"))
    poses = (sequence / "poses.txt").read_text().splitlines()
    for camera in ("image_0", "image_1"):
        (folder / camera).mkdir()
        for number, frame in enumerate(frames):
            path = folder / camera / f"{number:06d}.pgm"
            if frame is None:
                path.write_bytes(BLACK)
            else:
                shutil.copy(sequence / camera / f"{frame:06d}.pgm", path)
    (folder / "times.txt").write_text("".join(f"{0.05 * number:.6f}\n" for number in range(len(frames))))
    (folder / "poses.txt").write_text("".join(poses[frame or 0] + "\n" for frame in frames))
    return folder


def states(run: Finished) -> list[str]:
    with open(run.folder / "frames.csv", newline="") as file:
        return [row["state"] for row in csv.DictReader(file)]


@pytest.mark.parametrize("sensor", ["mono", "stereo"])
def test_a_camera_that_saw_nothing_is_found_where_it_was_before(
    tessera: Tessera, sequence: Path, tmp_path: Path, sensor: str
) -> None:
    frames = [*range(NUM_FRAMES), *[None] * NUM_BLACK, *range(20, 40)]
    blinded = rearrange(sequence, tmp_path / "blinded", frames)
    run = tessera.run(f"kitti:{blinded}", "--sensor", sensor).must_end_well()
    first_seen = NUM_FRAMES + NUM_BLACK
    assert states(run)[NUM_FRAMES:first_seen] == ["lost"] * NUM_BLACK
    assert set(states(run)[first_seen:]) == {"tracked"}  # from the first image on
    assert run.summary["tracking_failures"] == run.summary["relocalizations"] == 1
    assert run.summary["frames_lost"] == NUM_BLACK
    assert run.summary["rms_error_m"] < 0.05


def test_a_camera_that_was_carried_back_continues_in_the_same_map(
    tessera: Tessera, sequence: Path, tmp_path: Path
) -> None:
    jumping = rearrange(sequence, tmp_path / "jumping", [*range(NUM_FRAMES), *range(5, 25)])
    run = tessera.run(f"kitti:{jumping}", "--sensor", "stereo").must_end_well()
    assert run.summary["frames_lost"] == 0
    assert run.summary["tracking_failures"] == run.summary["relocalizations"] <= 1  # a small room: it may never be lost
    assert run.summary["rms_error_m"] < 0.05


@pytest.fixture(scope="module")
def saved(tessera: Tessera, sequence: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Finished, Path]:
    """A run and the map that it saved."""
    path = tmp_path_factory.mktemp("maps") / "room.tessera"
    run = tessera.run(f"kitti:{sequence}", "--sensor", "stereo", "--save-map", path).must_end_well()
    assert path.read_bytes() == (run.folder / "map.tessera").read_bytes()
    return run, path


def test_a_saved_map_places_every_frame_of_another_run(
    tessera: Tessera, sequence: Path, saved: tuple[Finished, Path]
) -> None:
    run, path = saved
    localized = tessera.run(
        f"kitti:{sequence}", "--sensor", "stereo", "--load-map", path, "--localize-only"
    ).must_end_well()
    assert set(states(localized)) == {"tracked"}
    assert localized.summary["map_sha256"] == run.summary["map_sha256"]
    assert localized.summary["rms_error_m"] < max(0.005, 1.2 * run.summary["rms_error_m"])


def test_a_saved_map_is_continued_and_again_the_same_each_time(
    tessera: Tessera, sequence: Path, saved: tuple[Finished, Path]
) -> None:
    run, path = saved
    continued = [
        tessera.run(
            f"kitti:{sequence}", "--sensor", "stereo", "--load-map", path, "--extractors", number, "--occupancy"
        ).must_end_well()
        for number in (1, 3)
    ]
    # The same way again: nothing is new.
    assert run.summary["keyframes"] <= continued[0].summary["keyframes"] < 1.5 * run.summary["keyframes"]
    once_more = tessera.run(
        f"kitti:{sequence}", "--sensor", "stereo", "--load-map", continued[0].folder / "map.tessera"
    ).must_end_well()
    assert once_more.summary["keyframes"] <= 1.5 * run.summary["keyframes"]
    assert continued[0].summary["frames_tracked"] == NUM_FRAMES
    for key in ("trajectory_sha256", "map_sha256", "occupancy_sha256"):
        assert continued[0].summary[key] == continued[1].summary[key] is not None


def test_a_replay_begins_with_the_map_that_the_run_began_with(
    tessera: Tessera, sequence: Path, saved: tuple[Finished, Path]
) -> None:
    _, path = saved
    words = ("--sensor", "stereo", "--frames", "10:30")
    run = tessera.run(f"kitti:{sequence}", *words, "--load-map", path, "--record").must_end_well()
    again = tessera.run(run.folder / "run.lcmlog", "--sensor", "stereo", command="replay").must_end_well()
    assert "the recorded run began with" in again.out + again.err
    for key in ("frames_tracked", "trajectory_sha256", "map_sha256", "warnings"):
        assert again.summary[key] == run.summary[key], key


def test_a_broken_map_file_is_refused_in_one_sentence(
    tessera: Tessera, sequence: Path, saved: tuple[Finished, Path], tmp_path: Path
) -> None:
    _, path = saved
    whole = path.read_bytes()
    cut = tmp_path / "cut.tessera"
    for tenth in (0, 3, 9):
        cut.write_bytes(whole[: len(whole) * tenth // 10])
        finished = tessera.run(f"kitti:{sequence}", "--sensor", "stereo", "--load-map", cut)
        assert finished.status == 2 and str(cut) in finished.err and "Traceback" not in finished.err
    finished = tessera.run(f"kitti:{sequence}", "--sensor", "mono", "--load-map", path)
    assert finished.status == 2 and "another camera or sensor" in finished.err


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["--load-map", "/no/such/map"], "there is no file"),
        (["--save-map", "/no/such/folder/map"], "there is no folder"),
        (["--localize-only"], "needs a map"),
        (["--localize-only", "--polish"], "--polish has no effect"),
        (["--set", "tracker.localize_only=true"], "--localize-only"),
    ],
)
def test_wrong_arguments_about_maps(tessera: Tessera, sequence: Path, arguments: list[Any], words: str) -> None:
    finished = tessera.run(f"kitti:{sequence}", *arguments)
    assert finished.status == 2 and words in finished.err


def test_the_vocabulary_is_part_of_the_project() -> None:
    assert (ROOT / "config" / "vocabulary.tvoc").stat().st_size < 8_000_000


def test_a_map_lasts_over_runs_and_a_loss_of_power(tessera: Tessera, sequence: Path, tmp_path: Path) -> None:
    """Saved while the run goes on; what was being written when everything was killed does not replace it."""
    lasting = tmp_path / "home.tessera"
    first = tessera.run(f"kitti:{sequence}", "--map", lasting, "--frames", "0:30").must_end_well()
    saved = lasting.read_bytes()
    assert saved == (first.folder / "map.tessera").read_bytes()
    folder = tmp_path / "killed"
    words = ("--map", lasting, "--pace", "0.3", "--set", "evaluator.save_period_s=0.2")
    second = tessera.start("run", f"kitti:{sequence}", *words, "--port", tessera.next_port(), "--out", folder)
    wait_for(lambda: lasting.read_bytes() != saved, "a newer map")
    for option in ("--map", "--save-map"):
        tessera.run(f"kitti:{sequence}", option, lasting).must_refuse(str(lasting), "is kept by another run")
    second.kill()  # the guard kills its stages
    second.wait()
    third = tessera.run(f"kitti:{sequence}", "--map", lasting, "--localize-only").must_end_well()
    assert third.summary["frames_tracked"] > 0.8 * NUM_FRAMES
    tessera.run(f"kitti:{sequence}", "--map", lasting, "--save-map", lasting).must_refuse("--map", "--save-map")
