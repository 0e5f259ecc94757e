"""Left images of the CAMERA channel, put together from their bands; and those of a recording."""

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from tessera_cli.constants import CAMERA
from tessera_cli.lcm_bus import log_messages
from tessera_cli.message_arrays import decode_arrays
from tessera_cli.messages import camera_image_t
from tessera_cli.settings import Settings

JPEG_QUALITY = 80
MAX_PIXELS = 1 << 26


class LeftImages:
    """Collects the bands of left images. Those of which a band was lost never become complete."""

    def __init__(self) -> None:
        self._frame = -1
        self._image = np.empty((0, 0), np.uint8)
        self._num_rows = 0

    def add(self, message: Any) -> np.ndarray | None:
        """A camera_image_t. The image, height x width, when this was its last band."""
        band, width, height = message.band, message.width, message.height
        pixels = band.pixels
        if band.image != band.LEFT or band.encoding != band.GRAY8:
            return None
        is_whole_rows = pixels.x == 0 and pixels.width == width and 0 <= pixels.y <= pixels.y + pixels.height <= height
        if not is_whole_rows or band.num_bytes != pixels.width * pixels.height or width * height > MAX_PIXELS:
            return None
        if message.frame != self._frame:
            self._frame, self._image, self._num_rows = message.frame, np.empty((height, width), np.uint8), 0
        if self._image.shape != (height, width):
            return None
        self._image[pixels.y : pixels.y + pixels.height] = band.data.reshape(pixels.height, width)
        self._num_rows += pixels.height
        return self._image if self._num_rows == height else None


def to_jpeg(image: np.ndarray) -> bytes:
    """Of a gray one."""
    file = io.BytesIO()
    Image.fromarray(image).save(file, "JPEG", quality=JPEG_QUALITY)
    return file.getvalue()


def left_images(log: Path, channel_prefix: str) -> Iterator[tuple[int, int, np.ndarray]]:
    """Frame, time in us, and image of every frame of a recorded log."""
    images = LeftImages()
    for data in log_messages(log, channel_prefix + CAMERA):
        message = decode_arrays(camera_image_t, data)
        image = images.add(message) if message is not None else None
        if message is not None and image is not None:
            yield message.frame, message.utime, image


def recording_of(folder: Path, settings: Settings) -> tuple[Path, str] | None:
    """The log of a run that was recorded, and the prefix of its channels; None: it was not."""
    log = folder / "run.lcmlog"
    if not log.is_file():
        return None
    return log, str(settings.get("bus", {}).get("channel_prefix") or "")
