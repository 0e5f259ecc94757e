"""How a map looks: frusta, covisibility, loops, landmarks."""

import numpy as np

from tessera_cli.maps.colors import height_colors, seen_colors
from tessera_cli.maps.map_replica import MapReplica
from tessera_cli.maps.poses import rotation_matrices
from tessera_cli.viewing.scene import (
    BLUE,
    COVISIBILITY,
    FAINT,
    KEYFRAMES,
    LANDMARKS,
    LOOP_ENDS,
    LOOPS,
    RED,
    Lines,
    Points,
    Shown,
)

# As in ORB-SLAM's essential graph, fewer shared landmarks say little.
MIN_SHARED = 100
# Of the median distance between neighboring keyframes.
FRUSTUM_DEPTH = 0.35
DEFAULT_FRUSTUM_DEPTH = 0.1


def shapes_of(replica: MapReplica, colors: np.ndarray | None) -> list[Shown]:
    """Nothing of a map without keyframes. `colors`: n x 3 bytes, of the landmarks; None: they show the height."""
    if not replica.keyframes:
        return []
    depth = frustum_depth(replica)
    positions = replica.positions[replica.landmark_ids()]
    centers = {number: keyframe.translation for number, keyframe in replica.keyframes.items()}
    loops = [
        np.stack([centers[loop.current], centers[loop.matched]])
        for loop in replica.loops
        if loop.current in centers and loop.matched in centers
    ]
    pairs = [np.stack([centers[a], centers[b]]) for a, b in covisible_pairs(replica)]
    return [
        Points(LANDMARKS, positions, height_colors(positions) if colors is None else seen_colors(colors), 1.5),
        Lines(KEYFRAMES, frusta(replica, depth), BLUE, 1.0),
        Lines(COVISIBILITY, pairs, FAINT, 0.6),
        Lines(LOOPS, loops, RED, 3.0),
        # Where the map agrees with itself a loop is too short to be seen as a line.
        Points(LOOP_ENDS, np.concatenate([np.empty((0, 3)), *loops]), RED, 4.0),
    ]


def frustum_depth(replica: MapReplica) -> float:
    """Fits the map, whose unit may be anything. Something where there is no map yet."""
    centers = np.array([keyframe.translation for _, keyframe in sorted(replica.keyframes.items())]).reshape(-1, 3)
    steps = np.linalg.norm(np.diff(centers, axis=0), axis=1)
    steps = steps[steps > 0]
    return FRUSTUM_DEPTH * float(np.median(steps)) if len(steps) else DEFAULT_FRUSTUM_DEPTH


def frusta(replica: MapReplica, depth: float) -> list[np.ndarray]:
    """For each keyframe, a line along the edges of what its camera sees up to this depth."""
    keyframes = [keyframe for _, keyframe in sorted(replica.keyframes.items())]
    rotations = rotation_matrices(np.array([keyframe.rotation_wxyz for keyframe in keyframes]))
    strips = []
    for keyframe, rotation in zip(keyframes, rotations):
        camera = keyframe.camera
        left, right = (depth * (u - camera.cx) / camera.fx for u in (0, camera.width))
        top, bottom = (depth * (v - camera.cy) / camera.fy for v in (0, camera.height))
        center, corners = (
            [0, 0, 0],
            [[x, y, depth] for x, y in ((left, top), (right, top), (right, bottom), (left, bottom))],
        )
        a, b, c, d = corners
        strip = np.array([center, a, b, c, d, a, center, b, c, center, d])
        strips.append(strip @ rotation.T + keyframe.translation)
    return strips


def covisible_pairs(replica: MapReplica, min_shared: int = MIN_SHARED) -> list[tuple[int, int]]:
    """Numbers of keyframes that see so many landmarks in common; and each with its parent."""
    from scipy.sparse import coo_array

    numbers = sorted(replica.keyframes)
    landmarks, keyframes, _ = replica.observations()
    pairs = {(k.parent, number) for number, k in replica.keyframes.items() if k.parent in replica.keyframes}
    if len(landmarks):
        rows = np.searchsorted(numbers, keyframes)
        shape = (len(numbers), int(landmarks.max()) + 1)
        sees = coo_array((np.ones(len(rows), np.int32), (rows, landmarks)), shape).tocsr()
        shared = (sees @ sees.T).tocoo()
        is_pair = (shared.row < shared.col) & (shared.data >= min_shared)
        found = zip(shared.row[is_pair].tolist(), shared.col[is_pair].tolist())
        pairs |= {(numbers[a], numbers[b]) for a, b in found}
    return sorted(pairs)
