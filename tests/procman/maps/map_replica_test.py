"""The copy of the map changes as the mapper's does, and refuses what does not fit."""

import numpy as np
import pytest

from helpers.made_map import (
    is_close,
    make_change,
    make_delta,
    make_keyframe,
    make_keypoints,
    make_landmark,
    make_observation,
    make_pose,
    two_views,
)
from tessera_cli.maps.map_replica import MapError, MapReplica
from tessera_cli.messages import message_types as tessera


def replica_of(*changes: tessera.map_change_t) -> MapReplica:
    replica = MapReplica()
    for number, change in enumerate(changes):
        replica.apply(make_delta(number, change).change)
    return replica


def test_keyframes_landmarks_and_observations() -> None:
    replica = replica_of(two_views())
    assert sorted(replica.keyframes) == [0, 1]
    assert replica.landmark_ids().tolist() == [3, 5]
    assert [column.tolist() for column in replica.observations()] == [[3, 3, 5], [0, 1, 1], [0, 0, 1]]
    assert replica.keyframes[1].frame == 10
    assert replica.keyframes[1].camera.fx == 500


def test_keyframes_move_and_landmarks_change() -> None:
    moved = make_change(
        moved_keyframes=[1],
        world_from_camera=[make_pose((2.0, 0.0, 0.0))],
        scale=[1.5],
        landmarks=[make_landmark(3, (9.0, 0.0, 5.0))],
    )
    replica = replica_of(two_views(), moved)
    assert is_close(replica.keyframes[1].translation, [2, 0, 0])
    assert replica.keyframes[1].scale == 1.5
    assert is_close(replica.positions[3], [9, 0, 5])


def test_another_lens_moves_keypoints_there_and_back() -> None:
    before = two_views()
    other = make_change()
    other.fx, other.fy, other.radial = 490.0, 480.0, -0.01
    replica = replica_of(before, other)
    camera = replica.keyframes[0].camera
    assert (camera.fx, camera.fy, camera.radial) == (490.0, 480.0, -0.01)
    # At (320, 240) is the center, nothing moves there; (10, 10) lies 1.2 half widths away: 4.5 px to the right.
    assert is_close(replica.keyframes[0].keypoints[0], [320, 240])
    assert np.abs(replica.keyframes[0].keypoints[1] - [14.511, 13.347]).max() < 0.002
    assert np.abs(camera.seen(replica.keyframes[0].keypoints) - [[320, 240], [10, 10]]).max() < 1e-4


def test_observations_landmarks_and_keyframes_go() -> None:
    removal = make_change(
        removed_observations=[make_observation(3, 1, 0), make_observation(5, 1, 1)],
        removed_landmarks=[5],
        removed_keyframes=[1],
    )
    replica = replica_of(two_views(), removal)
    assert replica.landmark_ids().tolist() == [3]
    assert replica.observations()[0].tolist() == [3]
    assert sorted(replica.keyframes) == [0]
    assert is_close(replica.removed[1].translation, [0.5, 0, 0])
    assert replica.removed[1].parent == 0


def test_a_keyframe_may_come_in_parts() -> None:
    first = make_keyframe(0, 0.0, [], keypoints=make_keypoints(0, [(1.0, 2.0)], first=0, total=2))
    second = make_keyframe(0, 0.0, [], keypoints=make_keypoints(0, [(3.0, 4.0)], first=1, total=2))
    replica = replica_of(make_change(new_keyframes=[first]), make_change(new_keyframes=[second]))
    assert replica.keyframes[0].keypoints.tolist() == [[1, 2], [3, 4]]


@pytest.mark.parametrize(
    "change",
    [
        make_change(new_observations=[make_observation(3, 9, 0)]),
        make_change(new_observations=[make_observation(3, 0, 2)]),
        make_change(landmarks=[make_landmark(-1, (0.0, 0.0, 0.0))]),
        make_change(landmarks=[make_landmark(1 << 40, (0.0, 0.0, 0.0))]),
        make_change(removed_keyframes=[4]),
        make_change(removed_landmarks=[1000]),
        make_change(new_keyframes=[make_keyframe(2, 0.0, [], keypoints=make_keypoints(0, [(1.0, 2.0)], first=5))]),
    ],
)
def test_what_does_not_fit_is_refused(change: tessera.map_change_t) -> None:
    replica = replica_of(two_views())
    with pytest.raises(MapError):
        replica.apply(make_delta(1, change).change)


def test_an_empty_map_has_no_observations() -> None:
    assert [len(column) for column in MapReplica().observations()] == [0, 0, 0]
    assert np.array_equal(MapReplica().landmark_ids(), [])
