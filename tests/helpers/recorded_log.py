"""A small log as the recorder writes it: two frames, the first a keyframe, of two extractors."""

from pathlib import Path
from typing import Any

import lcm

# When things were sent, in ms. Frame 0 is worked on by extractor_0, frame 1 by extractor_1.
CAMERA_MS, JOB_MS, CANDIDATES_MS, FEATURES_MS, POSE_MS = (0, 10), (2, 12), (14, 40), (16, 42), (22, 75)
KEYFRAME_MS, DELTA_MS, LOOP_MS = 21, 60, 68
KEYFRAME = 7  # the number of the keyframe that frame 0 becomes
DELTA = 9  # that answers it; frame 1 must see it
CAMERA_STEP_MS, DISPATCHER_STEP_MS = 3.0, 0.5


class LogWriter:
    """Messages of the types that the build generates; fields that play no part stay as they are made."""

    def __init__(self, path: Path) -> None:
        self._log = lcm.EventLog(str(path), "w", True)

    def write(self, channel: str, publisher: str, message: Any, sent_ms: float, part: int = 0) -> None:
        header = message.header
        header.publisher, header.utime = publisher, int(1000 * sent_ms)
        header.part, header.num_parts = part, 2
        self._log.write_event(header.utime, channel, message.encode())

    def close(self) -> None:
        self._log.close()


def message_of(type_name: str, **fields: Any) -> Any:
    import tessera  # generated; found where tessera_cli.messages looks

    message = getattr(tessera, type_name)()
    for name, value in fields.items():
        setattr(message, name, value)
    return message


def write_log(path: Path) -> Path:
    writer = LogWriter(path)
    for name, step_ms in (("camera", CAMERA_STEP_MS), ("dispatcher", DISPATCHER_STEP_MS)):
        writer.write("STATUS", name, message_of("stage_status_t", name=name, step_mean_ms=step_ms), 100)
    for frame in (0, 1):
        for part in (0, 1):
            writer.write("CAMERA", "camera", message_of("camera_image_t", frame=frame), CAMERA_MS[frame] + part, part)
        job = message_of("tile_job_t", frame=frame)
        writer.write(f"TILE_{frame}", "dispatcher", job, JOB_MS[frame])
        extractor = f"extractor_{frame}"
        writer.write("TILE_FEATURES", extractor, message_of("tile_features_t", frame=frame), CANDIDATES_MS[frame])
        features = message_of("features_t")
        features.keypoints.frame = frame
        writer.write("FEATURES", "reassembler", features, FEATURES_MS[frame])
        num_deltas = (0, DELTA + 1)[frame]
        writer.write("POSE", "tracker", message_of("pose_t", frame=frame, num_deltas=num_deltas), POSE_MS[frame])
    keyframe = message_of("keyframe_t", keyframe=KEYFRAME)
    keyframe.keypoints.frame = 0
    writer.write("KEYFRAME", "tracker", keyframe, KEYFRAME_MS)
    writer.write("MAP_DELTA", "mapper", message_of("map_delta_t", answers=KEYFRAME, number=DELTA), DELTA_MS)
    writer.write("LOOP_RESULT", "loop_closer", message_of("loop_result_t", keyframe=KEYFRAME), LOOP_MS)
    writer.write("HEARTBEAT", "mapper", message_of("heartbeat_t"), 200)
    writer.close()
    return path
