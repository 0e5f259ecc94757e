"""From where a map is seen as a person would want to see it."""

from dataclasses import dataclass

import numpy as np

from tessera_cli.maps.poses import rotation_matrices
from tessera_cli.runs.trajectories import Trajectory

# What is in sight: half the width and half the height, over the distance. 75 degrees across, 3 : 2.
SIGHT = np.array([0.77, 0.51])
# The eye is drawn back and raised from the camera by these shares of the distance of what the camera sees.
BACK, RAISED = 0.3, 0.12
# Poses that are tried, and points.
NUM_POSES, NUM_POINTS = 24, 20_000
MOST = 0.9


@dataclass(frozen=True)
class Viewpoint:
    eye: np.ndarray
    target: np.ndarray
    world_from_eye: np.ndarray  # 3 x 3: x right, y down, z forward
    nearest: float  # what is nearer to the eye may stand behind the camera, and hide what it sees
    distance: float  # median of what the camera sees
    reach: float  # most of it is nearer to the camera


def over_the_shoulder(points: np.ndarray, trajectory: Trajectory) -> Viewpoint:
    """Behind and above the camera where it has the most of n x 3 points in sight; upright, since y points down."""
    points = points[:: max(1, len(points) // NUM_POINTS)]
    rows = np.unique(np.linspace(0, len(trajectory.positions) - 1, NUM_POSES).astype(int))
    rotations = rotation_matrices(np.roll(trajectory.quaternions_xyzw[rows], 1, axis=1))
    position, rotation, depths = trajectory.positions[0], rotations[0], np.empty(0)
    for row, candidate in zip(rows, rotations):
        in_camera = (points - trajectory.positions[row]) @ candidate
        is_seen = (in_camera[:, 2] > 0) & (np.abs(in_camera[:, :2]) < in_camera[:, 2:] * SIGHT).all(axis=1)
        if is_seen.sum() > len(depths):
            position, rotation, depths = trajectory.positions[row], candidate, in_camera[is_seen, 2]
    distance = float(np.median(depths)) if len(depths) else 1.0
    eye = position - distance * (BACK * rotation[:, 2] + [0.0, RAISED, 0.0])
    target = position + distance * rotation[:, 2]
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross([0.0, 1.0, 0.0], forward)
    if np.linalg.norm(right) < 0.1:
        right = rotation[:, 0] - rotation[:, 0] @ forward * forward  # straight up or down
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(forward, right), forward], axis=1)
    reach = float(np.quantile(depths, MOST)) if len(depths) else distance
    return Viewpoint(eye, target, axes, 0.9 * BACK * distance, distance, reach)
