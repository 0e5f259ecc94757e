"""The message types that the build generates from lcmtypes/."""

import sys

from tessera_cli.files import BUILD

sys.path.insert(0, str(BUILD / "lcmtypes" / "python"))

from tessera import camera_image_t, end_of_stream_t, pose_t, stage_status_t  # noqa: E402

__all__ = ["camera_image_t", "end_of_stream_t", "pose_t", "stage_status_t"]
