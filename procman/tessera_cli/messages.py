"""The message types that the build generates from lcmtypes/."""

import sys

from tessera_cli.files import BUILD

sys.path.insert(0, str(BUILD / "lcmtypes" / "python"))

from tessera import (
    camera_image_t,
    end_of_stream_t,
    header_t,
    heartbeat_t,
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
    "camera_image_t",
    "end_of_stream_t",
    "header_t",
    "heartbeat_t",
    "pose_t",
    "procman_list_t",
    "procman_order_t",
    "procman_output_t",
    "procman_process_t",
    "procman_status_t",
    "procman_wish_t",
    "stage_status_t",
]
