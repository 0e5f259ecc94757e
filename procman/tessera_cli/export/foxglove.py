"""Messages of Foxglove's schemas, as JSON: what stands in them, and how a file describes that.

Frames: `map` has z up, `world` is the map's own (x right, y down, z forward of the first camera), `camera` moves in it.
"""

import base64
from typing import Any

import numpy as np

from tessera_cli.maps.camera_model import CameraModel
from tessera_cli.maps.occupancy_file import Grid

MAP, WORLD, CAMERA = "map", "world", "camera"
# map_from_world: x stays, the camera's forward becomes y, and up is z.
MAP_FROM_WORLD_XYZW = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)
NS_PER_S = 1_000_000_000
# PackedElementField's numeric types.
UINT8, FLOAT32 = 1, 7

Json = dict[str, Any]


# --- Schemas ------------------------------------------------------------------------------------------------------
def _object(**properties: Json) -> Json:
    return {"type": "object", "properties": properties}


NUMBER: Json = {"type": "number"}
INTEGER: Json = {"type": "integer"}
TEXT: Json = {"type": "string"}
BYTES: Json = {"type": "string", "contentEncoding": "base64"}
TIME = _object(sec=INTEGER, nsec=INTEGER)
VECTOR = _object(x=NUMBER, y=NUMBER, z=NUMBER)
QUATERNION = _object(x=NUMBER, y=NUMBER, z=NUMBER, w=NUMBER)
POSE = _object(position=VECTOR, orientation=QUATERNION)
FIELDS: Json = {"type": "array", "items": _object(name=TEXT, offset=INTEGER, type=INTEGER)}
NUMBERS: Json = {"type": "array", "items": NUMBER}
STAMP = {"timestamp": TIME, "frame_id": TEXT}

SCHEMAS: dict[str, Json] = {
    "foxglove.FrameTransform": _object(
        timestamp=TIME, parent_frame_id=TEXT, child_frame_id=TEXT, translation=VECTOR, rotation=QUATERNION
    ),
    "foxglove.PoseInFrame": _object(**STAMP, pose=POSE),
    "foxglove.PosesInFrame": _object(**STAMP, poses={"type": "array", "items": POSE}),
    "foxglove.PointCloud": _object(**STAMP, pose=POSE, point_stride=INTEGER, fields=FIELDS, data=BYTES),
    "foxglove.CompressedImage": _object(**STAMP, data=BYTES, format=TEXT),
    "foxglove.CameraCalibration": _object(
        **STAMP, width=INTEGER, height=INTEGER, distortion_model=TEXT, D=NUMBERS, K=NUMBERS, R=NUMBERS, P=NUMBERS
    ),
    "foxglove.Grid": _object(
        **STAMP,
        pose=POSE,
        column_count=INTEGER,
        cell_size=_object(x=NUMBER, y=NUMBER),
        row_stride=INTEGER,
        cell_stride=INTEGER,
        fields=FIELDS,
        data=BYTES,
    ),
    # What frames.csv says of a frame, for curves.
    "tessera.Frame": _object(
        frame=INTEGER, state=TEXT, latency_ms=NUMBER, pose_time_ms=NUMBER, matches=NUMBER, inliers=NUMBER
    ),
}


# --- Messages -----------------------------------------------------------------------------------------------------
def stamp(time_ns: int, frame_id: str = WORLD) -> Json:
    return {"timestamp": _time(time_ns), "frame_id": frame_id}


def pose(position: Any, quaternion_xyzw: Any) -> Json:
    return {"position": _vector(position), "orientation": _quaternion(quaternion_xyzw)}


def transform(time_ns: int, parent: str, child: str, position: Any, quaternion_xyzw: Any) -> Json:
    """Parent from child."""
    names = {"timestamp": _time(time_ns), "parent_frame_id": parent, "child_frame_id": child}
    return {**names, "translation": _vector(position), "rotation": _quaternion(quaternion_xyzw)}


def poses(time_ns: int, positions: np.ndarray, quaternions_xyzw: np.ndarray) -> Json:
    return {**stamp(time_ns), "poses": [pose(*both) for both in zip(positions.tolist(), quaternions_xyzw.tolist())]}


def point_cloud(time_ns: int, positions: np.ndarray, colors: np.ndarray | None) -> Json:
    """Both n x 3; colors are bytes."""
    fields = [{"name": name, "offset": 4 * index, "type": FLOAT32} for index, name in enumerate("xyz")]
    points = np.ascontiguousarray(positions, "<f4").view(np.uint8).reshape(len(positions), 12)
    if colors is not None:
        names = ("red", "green", "blue", "alpha")
        fields += [{"name": name, "offset": 12 + index, "type": UINT8} for index, name in enumerate(names)]
        points = np.hstack([points, colors, np.full((len(colors), 1), 255, np.uint8)])
    data = _base64(points.tobytes())
    return {**stamp(time_ns), "pose": _IDENTITY, "point_stride": points.shape[1], "fields": fields, "data": data}


def compressed_image(time_ns: int, jpeg: bytes) -> Json:
    return {**stamp(time_ns, CAMERA), "data": _base64(jpeg), "format": "jpeg"}


def calibration(time_ns: int, camera: CameraModel) -> Json:
    k = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
    size = {"width": camera.width, "height": camera.height, "distortion_model": "plumb_bob", "D": [0.0] * 5}
    rotation = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    return {**stamp(time_ns, CAMERA), **size, "K": k, "R": rotation, "P": [*k[:3], 0.0, *k[3:6], 0.0, *k[6:], 0.0]}


def grid(time_ns: int, seen: Grid, height: float) -> Json:
    """At this height, along the grid's up axis. Rows begin with the lowest y."""
    from scipy.spatial.transform import Rotation

    corner = seen.origin @ seen.axes[:2] + height * seen.axes[2]
    rows = seen.image[::-1]
    return {
        **stamp(time_ns),
        "pose": pose(corner.tolist(), Rotation.from_matrix(seen.axes.T).as_quat().tolist()),
        "column_count": rows.shape[1],
        "cell_size": {"x": seen.resolution, "y": seen.resolution},
        "row_stride": rows.shape[1],
        "cell_stride": 1,
        "fields": [{"name": "gray", "offset": 0, "type": UINT8}],
        "data": _base64(rows.tobytes()),
    }


def _time(time_ns: int) -> Json:
    return {"sec": time_ns // NS_PER_S, "nsec": time_ns % NS_PER_S}


def _vector(values: Any) -> Json:
    return dict(zip("xyz", map(float, values)))


def _quaternion(xyzw: Any) -> Json:
    return dict(zip("xyzw", map(float, xyzw)))


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode()


_IDENTITY = pose((0, 0, 0), (0, 0, 0, 1))
