"""Left images of the channels CAMERA and COLOR, put together from their bands; and those of a recording."""

import io
from collections.abc import Container, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from tessera_cli.constants import CAMERA, COLOR
from tessera_cli.lcm_bus import log_messages
from tessera_cli.message_arrays import decode_arrays
from tessera_cli.messages import camera_image_t, color_image_t
from tessera_cli.settings import Settings

JPEG_QUALITY = 80
MAX_PIXELS = 1 << 26


class LeftImages:
    """Collects the bands of left images. Those of which a band was lost never become complete."""

    def __init__(self, has_color: bool = False) -> None:
        """`has_color`: of COLOR, instead of CAMERA."""
        self._depth = (3,) if has_color else ()
        self._frame = -1
        self._image = np.empty((0, 0), np.uint8)
        self._num_rows = 0

    def add(self, message: Any) -> np.ndarray | None:
        """A camera_image_t or color_image_t. The image, height x width (x 3), when this was its last band."""
        band, width, height = message.band, message.width, message.height
        pixels = band.pixels
        if band.image != band.LEFT or band.encoding != (band.RGB8 if self._depth else band.GRAY8) or not band.num_bytes:
            return None
        pixel_bytes = self._depth[0] if self._depth else 1
        is_whole_rows = pixels.x == 0 and pixels.width == width and 0 <= pixels.y <= pixels.y + pixels.height <= height
        if (
            not is_whole_rows
            or band.num_bytes != pixel_bytes * pixels.width * pixels.height
            or width * height > MAX_PIXELS
        ):
            return None
        shape = (height, width, *self._depth)
        if message.frame != self._frame:
            self._frame, self._image, self._num_rows = message.frame, np.empty(shape, np.uint8), 0
        if self._image.shape != shape:
            return None
        self._image[pixels.y : pixels.y + pixels.height] = band.data.reshape(pixels.height, *shape[1:])
        self._num_rows += pixels.height
        return self._image if self._num_rows == height else None


def to_jpeg(image: np.ndarray) -> bytes:
    """Of a gray or colored one."""
    file = io.BytesIO()
    Image.fromarray(image).save(file, "JPEG", quality=JPEG_QUALITY)
    return file.getvalue()


def left_images(log: Path, channel_prefix: str) -> Iterator[tuple[int, int, np.ndarray]]:
    """Frame, time in us, and image of every frame of a recorded log."""
    yield from _images(log, channel_prefix + CAMERA, camera_image_t, LeftImages())


def color_images(log: Path, channel_prefix: str) -> Iterator[tuple[int, int, np.ndarray]]:
    """Likewise of keyframes in color; none if the run was not recorded with color."""
    yield from _images(log, channel_prefix + COLOR, color_image_t, LeftImages(has_color=True))


def _images(log: Path, channel: str, message_type: Any, images: LeftImages) -> Iterator[tuple[int, int, np.ndarray]]:
    for data in log_messages(log, channel):
        message = decode_arrays(message_type, data)
        image = images.add(message) if message is not None else None
        if message is not None and image is not None:
            yield message.frame, message.utime, image


def best_images(log: Path, channel_prefix: str, frames: Container[int]) -> Iterator[tuple[int, int, np.ndarray]]:
    """Of these frames: in color where there is one, else gray."""
    in_color = set()
    for frame, utime_us, image in color_images(log, channel_prefix):
        if frame in frames and frame not in in_color:
            in_color.add(frame)
            yield frame, utime_us, image
    for frame, utime_us, image in left_images(log, channel_prefix):
        if frame in frames and frame not in in_color:
            yield frame, utime_us, image


def recording_of(folder: Path, settings: Settings) -> tuple[Path, str] | None:
    """The log of a run that was recorded, and the prefix of its channels; None: it was not."""
    log = folder / "run.lcmlog"
    if not log.is_file():
        return None
    return log, str(settings.get("bus", {}).get("channel_prefix") or "")
