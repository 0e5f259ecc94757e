"""Which keypoints are tracked, new and lost; and where tiles meet."""

import numpy as np

from helpers.made_map import is_close, make_delta, two_views
from tessera_cli.maps.map_replica import MapReplica
from tessera_cli.viewing.keypoints import of_frame, of_keyframe, project, tile_borders

NOWHERE = np.empty(0, int)
IDENTITY = np.array([1.0, 0, 0, 0])


def made_replica() -> MapReplica:
    replica = MapReplica()
    replica.apply(make_delta(0, two_views()).change)
    return replica


def test_points_are_seen_where_the_pinhole_says() -> None:
    camera = made_replica().keyframes[0].camera
    points = np.array([[0.0, 0, 5], [1, 0, 5], [0, 0, -5], [100, 0, 5]])
    pixels = project(camera, IDENTITY, np.zeros(3), points)
    assert is_close(pixels[:2], [[320, 240], [420, 240]])
    assert np.isnan(pixels[2:]).all(), "behind the camera, and beside the image"


def test_a_keyframe_shows_what_the_map_says() -> None:
    replica = made_replica()
    found = of_keyframe(replica.keyframes[0], replica, before=np.array([3, 5]))
    assert is_close(found.tracked, [[320, 240]])
    assert is_close(found.new, [[10, 10]])
    assert is_close(found.lost, [[420, 240]]), "landmark 5 should be seen there"
    assert found.landmarks.tolist() == [3]


def test_a_frame_shows_landmarks_that_are_near_and_look_alike() -> None:
    replica = made_replica()
    pixels = np.array([[321, 241], [419, 240], [100, 100]], np.float32)
    same, other = np.zeros(32, np.uint8), np.full(32, 255, np.uint8)
    pose = (IDENTITY, np.zeros(3))
    camera, candidates = replica.keyframes[0].camera, np.array([3, 5])
    found = of_frame(pixels, np.stack([same, other, same]), camera, pose, replica, candidates, NOWHERE)
    assert found.landmarks.tolist() == [3, 5]
    assert is_close(found.tracked, pixels[:2])
    assert is_close(found.new, pixels[2:])
    found = of_frame(pixels, np.stack([other, other, same]), camera, pose, replica, candidates, candidates)
    assert found.landmarks.tolist() == [5], "the first keypoint looks different"
    assert is_close(found.lost, [[320, 240]])


def test_each_landmark_is_shown_by_the_keypoint_that_is_most_alike() -> None:
    replica = made_replica()
    near = np.zeros(32, np.uint8)
    near[0] = 3
    pixels = np.array([[321, 240], [320, 240]], np.float32)
    descriptors = np.stack([near, np.zeros(32, np.uint8)])
    pose = (IDENTITY, np.zeros(3))
    found = of_frame(pixels, descriptors, replica.keyframes[0].camera, pose, replica, np.array([3]), NOWHERE)
    assert is_close(found.tracked, [[320, 240]])
    assert is_close(found.new, [[321, 240]])


def test_tiles_meet_at_whole_pixels() -> None:
    assert tile_borders(1, 1, 640, 480) == []
    borders = tile_borders(2, 3, 640, 480)
    assert is_close(borders, [[[212.5, -0.5], [212.5, 479.5]], [[425.5, -0.5], [425.5, 479.5]],
                              [[-0.5, 239.5], [639.5, 239.5]]])  # fmt: skip
