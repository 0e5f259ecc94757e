"""Rigid poses as arrays: rotations as unit quaternions with w first, positions in meters (mono: units of the map)."""

import numpy as np


def rotation_matrices(quaternions_wxyz: np.ndarray) -> np.ndarray:
    """N x 3 x 3 of n x 4."""
    w, x, y, z = np.moveaxis(np.asarray(quaternions_wxyz, float).reshape(-1, 4), 1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def multiply(a_wxyz: np.ndarray, b_wxyz: np.ndarray) -> np.ndarray:
    """The rotation by b, then by a."""
    aw, ax, ay, az = a_wxyz
    bw, bx, by, bz = b_wxyz
    return np.array(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ]
    )


def conjugate(quaternion_wxyz: np.ndarray) -> np.ndarray:
    return np.asarray(quaternion_wxyz) * [1, -1, -1, -1]


def rotate(quaternion_wxyz: np.ndarray, points: np.ndarray) -> np.ndarray:
    """N x 3."""
    return np.asarray(points) @ rotation_matrices(quaternion_wxyz)[0].T
