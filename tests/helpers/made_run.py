"""A run's folder without a run: what the stages would have left of a drive around a block, with a known error."""

import json
from pathlib import Path
from typing import Any

import numpy as np

NUM_FRAMES = 120
LOST = (40, 41, 42, 77)
NOISE_M = 0.05
PROCESSES = ("camera", "dispatcher", "extractor_0", "extractor_1", "reassembler", "tracker", "mapper", "evaluator")
IDENTITY = "0 0 0 1"


def true_position(frame: int) -> np.ndarray:
    angle = 2 * np.pi * frame / (NUM_FRAMES - 10)  # the last ten frames see the start again
    return np.array([20 * np.sin(angle), -1.6 + 0.1 * np.sin(5 * angle), 30 * (1 - np.cos(angle))])


def tum_row(frame: int, position: np.ndarray) -> str:
    return f"{0.1 * frame:.6f} {' '.join(f'{value:.9f}' for value in position)} {IDENTITY}\n"


def write_run(folder: Path, seed: int = 1, truth: bool = True, loops: bool = True, **summary: Any) -> Path:
    """`summary`: what differs from a good run. Returns the folder."""
    (folder / "stages").mkdir(parents=True)
    generator = np.random.default_rng(seed)
    tracked = [frame for frame in range(NUM_FRAMES) if frame not in LOST]
    rows = {frame: tum_row(frame, true_position(frame) + generator.normal(0, NOISE_M, 3)) for frame in tracked}
    for name in ("trajectory.txt", "trajectory_live.txt", "keyframes.txt"):
        (folder / name).write_text("# timestamp tx ty tz qx qy qz qw\n" + "".join(rows.values()))
    if truth:
        (folder / "ground_truth.txt").write_text(
            "".join(tum_row(frame, true_position(frame)) for frame in range(NUM_FRAMES))
        )
    if loops:
        (folder / "loops.csv").write_text(
            "keyframe_timestamp_s,matched_timestamp_s,inliers,scale\n11.500000,0.500000,80,1.0\n"
        )
    (folder / "frames.csv").write_text(_frames_csv())
    (folder / "settings.yaml").write_text("features:\n  num_features: 1234\n")
    (folder / "summary.json").write_text(json.dumps({**_summary(loops), **summary}))
    return folder


def _frames_csv() -> str:
    rows = [
        "frame,utime_us,state,pose_time_ms,latency_ms,map_wait_ms,features,matches,inliers,landmarks,is_keyframe,num_deltas"
    ]
    for frame in range(NUM_FRAMES):
        state = "lost" if frame in LOST else "tracked"
        pose_time = "" if frame == 0 else f"{20 + frame % 7}.0"
        rows.append(
            f"{frame},{100000 * frame},{state},{pose_time},{60 + frame % 11}.0,{frame % 3}.0,2000,500,{400 - frame},"
            f"{1000 + 50 * frame},{int(frame % 5 == 0)},0"
        )
    return "\n".join(rows) + "\n"


def _summary(loops: bool) -> dict[str, Any]:
    times = {"mean": 23.0, "median": 23.0, "p95": 26.0, "p99": 26.0, "max": 26.0}
    waits = {"mean": 1.0, "median": 1.0, "p95": 2.0, "p99": 2.0, "max": 2.0}
    return {
        "source": "sim:block",
        "sensor": "stereo",
        "extractors": 2,
        "tiles": "2x2",
        "ended": "complete",
        "frames": NUM_FRAMES,
        "frames_tracked": NUM_FRAMES - len(LOST),
        "frames_lost": len(LOST),
        "frames_initializing": 0,
        "frames_dropped": 0,
        "tracking_failures": 2,
        "keyframes": 24,
        "landmarks": 7000,
        "pose_time_ms": times,
        "latency_ms": times,
        "map_wait_ms": waits,
        "stage_ms": dict.fromkeys(PROCESSES[:-1], times),
        "messages_repaired": 0,
        "messages_lost": 0,
        "messages_undecodable": 0,
        "messages_of_strangers": 0,
        "trajectory_sha256": "ab" * 32,
        "map_sha256": "cd" * 32,
        "rms_error_m": 0.02,
        "alignment": "SE(3) over 117 frames",
        "relocalizations": 2,
        "loops_closed": int(loops),
        "wall_s": 2.8,
        "frames_per_s": 42.9,
        "cpu_s": dict.fromkeys(PROCESSES, 1.5),
        "max_rss_mb": dict.fromkeys(PROCESSES, 70.0),
        "extractor_restarts": 0,
        "warnings": [],
        "not_written": [],
        "versions": {"Tessera": "0123456789ab", "LCM": "1.5.3"},
    }
