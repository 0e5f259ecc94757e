"""The camera as the map has it: a rectified pinhole, whose images may have been corrected further (`radial`)."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np


@dataclass(frozen=True)
class CameraModel:
    """x right, y down, z forward; pixel (0, 0) is the center of the top left pixel.

    `radial`: the mapper may find that images are distorted by a little, and moves keypoints. With r = |pixel - center|
    over half the image's width:

        moved - center = (1 + radial r^2) (pixel - center)
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    is_mono: bool = True
    radial: float = 0.0

    @classmethod
    def of(cls, message: Any, radial: float = 0.0) -> "CameraModel":
        """Of a camera_model_t."""
        numbers = (message.fx, message.fy, message.cx, message.cy)
        return cls(message.width, message.height, *numbers, is_mono=message.sensor == message.MONO, radial=radial)

    def with_lens(self, fx: float, fy: float, radial: float) -> "CameraModel":
        return replace(self, fx=fx, fy=fy, radial=radial)

    def moved(self, pixels: np.ndarray) -> np.ndarray:
        """Where points of the image, n x 2, stand once it is corrected."""
        from_center = pixels - [self.cx, self.cy]
        squares = (from_center**2).sum(axis=1, keepdims=True) / (0.5 * self.width) ** 2
        return np.asarray(pixels + self.radial * squares * from_center)

    def seen(self, moved: np.ndarray) -> np.ndarray:
        """Where points of the corrected image, n x 2, stand in the camera's."""
        pixels = moved.astype(float)
        for _ in range(8 if self.radial else 0):
            pixels = pixels + moved - self.moved(pixels)
        return pixels
