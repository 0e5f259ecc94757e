"""Changes of a map, as messages, of a map that no run made."""

from typing import Any

import numpy as np

from tessera_cli.message_arrays import decode_arrays
from tessera_cli.messages import message_types as tessera

CAMERA = {"width": 640, "height": 480, "fx": 500.0, "fy": 500.0, "cx": 320.0, "cy": 240.0}
DESCRIPTOR_BYTES = 32


def set_header(message: Any, part: int = 0, num_parts: int = 1) -> Any:
    message.header.publisher, message.header.epoch_us = "mapper", 1
    message.header.part, message.header.num_parts = part, num_parts
    return message


def make_camera() -> tessera.camera_model_t:
    camera = tessera.camera_model_t()
    for name, value in CAMERA.items():
        setattr(camera, name, value)
    return camera


def make_pose(translation: tuple[float, float, float]) -> tessera.rigid3_t:
    pose = tessera.rigid3_t()
    pose.rotation_wxyz, pose.translation = [1.0, 0.0, 0.0, 0.0], list(translation)
    return pose


def make_keypoints(frame: int, pixels: list[tuple[float, float]], first: int = 0, total: int = -1) -> Any:
    """`total`: where the others come in further parts."""
    keypoints = tessera.keypoints_t()
    keypoints.frame, keypoints.utime, keypoints.camera = frame, 100_000 * frame, make_camera()
    keypoints.num_keypoints, keypoints.first = len(pixels), first
    keypoints.num_total = len(pixels) if total < 0 else total
    keypoints.x, keypoints.y = [x for x, _ in pixels], [y for _, y in pixels]
    keypoints.level = keypoints.angle = bytes(len(pixels))
    keypoints.score = [0] * len(pixels)
    keypoints.right_x = keypoints.depth_m = [-1.0] * len(pixels)
    keypoints.descriptors = [make_descriptor(0) for _ in pixels]
    return keypoints


def make_descriptor(value: int) -> tessera.descriptor_t:
    descriptor = tessera.descriptor_t()
    descriptor.bits = bytes([value] * DESCRIPTOR_BYTES)
    return descriptor


def make_keyframe(number: int, x: float, pixels: list[tuple[float, float]], **changes: Any) -> Any:
    """At (x, 0, 0), looking along z; taken at frame 10 * number."""
    keyframe = tessera.map_keyframe_t()
    keyframe.keyframe, keyframe.parent, keyframe.scale = number, number - 1, 1.0
    keyframe.world_from_camera = make_pose((x, 0.0, 0.0))
    keyframe.keypoints = make_keypoints(10 * number, pixels)
    for name, value in changes.items():
        setattr(keyframe, name, value)
    return keyframe


def make_landmark(number: int, position: tuple[float, float, float], descriptor: int = 0) -> tessera.map_landmark_t:
    landmark = tessera.map_landmark_t()
    landmark.landmark, landmark.position_in_world = number, list(position)
    landmark.normal, landmark.descriptor = [0.0, 0.0, -1.0], make_descriptor(descriptor)
    return landmark


def make_observation(landmark: int, keyframe: int, keypoint: int) -> tessera.map_observation_t:
    observation = tessera.map_observation_t()
    observation.landmark, observation.keyframe, observation.keypoint = landmark, keyframe, keypoint
    return observation


def make_change(**lists: list[Any]) -> tessera.map_change_t:
    """Lists by their names in map_change_t."""
    change = tessera.map_change_t()
    for name, items in lists.items():
        setattr(change, name, items)
    change.num_new_keyframes, change.num_moved_keyframes = len(change.new_keyframes), len(change.moved_keyframes)
    change.num_landmarks, change.num_changed_parents = len(change.landmarks), len(change.children)
    change.num_removed_observations = len(change.removed_observations)
    change.num_new_observations = len(change.new_observations)
    change.num_removed_landmarks = len(change.removed_landmarks)
    change.num_removed_keyframes = len(change.removed_keyframes)
    change.num_closed_loops = len(change.closed_loops)
    return change


def two_views(**changes: list[Any]) -> tessera.map_change_t:
    """Keyframes 0 and 1, half a meter apart, see landmarks 3 and 5, five meters away; landmark 5 only keyframe 1."""
    lists: dict[str, list[Any]] = {
        "new_keyframes": [
            make_keyframe(0, 0.0, [(320.0, 240.0), (10.0, 10.0)]),
            make_keyframe(1, 0.5, [(270.0, 240.0), (370.0, 240.0)]),
        ],
        "landmarks": [make_landmark(3, (0.0, 0.0, 5.0)), make_landmark(5, (1.0, 0.0, 5.0), descriptor=255)],
        "new_observations": [make_observation(3, 0, 0), make_observation(3, 1, 0), make_observation(5, 1, 1)],
    }
    return make_change(**{**lists, **changes})


def make_delta(number: int, change: tessera.map_change_t, part: int = 0, num_parts: int = 1) -> Any:
    """As it is when it was received."""
    delta = set_header(tessera.map_delta_t(), part, num_parts)
    delta.number, delta.change = number, change
    return received(delta)


def make_page(number: int, page: int, num_pages: int, change: tessera.map_change_t) -> Any:
    """As it is when it was received."""
    snapshot = set_header(tessera.map_snapshot_t())
    snapshot.number, snapshot.page, snapshot.num_pages, snapshot.change = number, page, num_pages, change
    return received(snapshot)


def received(message: Any) -> Any:
    decoded = decode_arrays(type(message), message.encode())
    assert decoded is not None
    return decoded


def is_close(a: Any, b: Any) -> bool:
    return bool(np.allclose(a, b, atol=1e-6))
