"""The message types that the build generates from lcmtypes/, and how their bytes are decoded."""

import functools
import importlib
import struct
import sys
from typing import Any

from tessera_cli.files import BUILD

sys.path.insert(0, str(BUILD / "lcmtypes" / "python"))

import tessera as message_types
from tessera import (
    calibration_t,
    camera_image_t,
    end_of_stream_t,
    features_t,
    ground_truth_t,
    header_t,
    heartbeat_t,
    map_delta_t,
    map_file_t,
    map_request_t,
    map_snapshot_t,
    pose_t,
    procman_list_t,
    procman_order_t,
    procman_output_t,
    procman_process_t,
    procman_status_t,
    procman_wish_t,
    stage_status_t,
)

__all__ = [
    "calibration_t",
    "camera_image_t",
    "decode",
    "decode_as",
    "end_of_stream_t",
    "features_t",
    "ground_truth_t",
    "header_t",
    "heartbeat_t",
    "map_delta_t",
    "map_file_t",
    "map_request_t",
    "map_snapshot_t",
    "message_types",
    "pose_t",
    "procman_list_t",
    "procman_order_t",
    "procman_output_t",
    "procman_process_t",
    "procman_status_t",
    "procman_wish_t",
    "stage_status_t",
    "type_of",
]

# Every message begins with what tells its type.
FINGERPRINT_BYTES = 8

# What generated code raises on bytes that are no such message.
_DECODE_ERRORS = (ValueError, struct.error, MemoryError, IndexError, OverflowError, TypeError)


def decode(message_type: Any, data: bytes) -> Any | None:
    """The message, or None if the bytes are not a valid one of this type."""
    try:
        return message_type.decode(data)
    except _DECODE_ERRORS:
        return None


def decode_as(type_name: str, data: bytes) -> Any | None:
    """As `decode`, of the type of this name; None also if the build, of another commit, has no such type."""
    message_type = getattr(importlib.import_module("tessera"), type_name, None)
    return decode(message_type, data) if message_type else None


def type_of(data: bytes) -> Any | None:
    """The type of message that these bytes begin like; None: none of this version."""
    return _types_by_fingerprint().get(data[:FINGERPRINT_BYTES])


@functools.cache
def _types_by_fingerprint() -> dict[bytes, Any]:
    types: list[Any] = [value for name, value in vars(message_types).items() if name.endswith("_t")]
    return {value._get_packed_fingerprint(): value for value in types if hasattr(value, "_get_packed_fingerprint")}
