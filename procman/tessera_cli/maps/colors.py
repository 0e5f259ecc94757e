"""Colors of landmarks and voxels."""

import numpy as np

from tessera_cli.maps.occupancy_file import Voxels

# Landmarks between these quantiles of height spread over all colors.
LOW, HIGH = 0.05, 0.95
# Brightnesses between these quantiles are spread from DARKEST to white.
DARK, BRIGHT, DARKEST, GAMMA = 0.02, 0.98, 30, 0.7
# From low to high.
HEIGHT_COLORS = np.array([[66, 94, 168], [60, 160, 160], [150, 200, 110], [250, 220, 120]], float)


def height_bounds(positions: np.ndarray) -> tuple[float, float]:
    """Lowest and highest of n x 3, without the few beyond; y points down."""
    low, high = np.quantile(-positions[:, 1], [LOW, HIGH])
    return float(low), float(high)


def height_colors(positions: np.ndarray, bounds: tuple[float, float] | None = None) -> np.ndarray:
    """N x 3 bytes, from low to high, which are those of the positions where no bounds are given."""
    if not len(positions):
        return np.empty((0, 3), np.uint8)
    low, high = bounds or height_bounds(positions)
    share = np.clip((-positions[:, 1] - low) / max(high - low, 1e-9), 0, 1) * (len(HEIGHT_COLORS) - 1)
    steps = np.arange(len(HEIGHT_COLORS))
    return np.stack([np.interp(share, steps, column) for column in HEIGHT_COLORS.T], axis=1).astype(np.uint8)


def seen_bounds(colors: np.ndarray) -> tuple[float, float]:
    """Darkest and brightest of n x 3 (0..255), without the few beyond."""
    low, high = np.quantile(colors.mean(axis=1), [DARK, BRIGHT])
    return float(low), float(high)


def seen_colors(colors: np.ndarray, bounds: tuple[float, float] | None = None) -> np.ndarray:
    """N x 3 bytes of n x 3: what occurs spread over all that a screen shows, dark made lighter.

    `bounds`: the brightnesses that are spread; those of these colors where none are given.
    """
    if not len(colors):
        return np.empty((0, 3), np.uint8)
    low, high = bounds or seen_bounds(colors)
    share = np.clip((colors - low) / max(high - low, 1.0), 0, 1) ** GAMMA
    return (DARKEST + (255 - DARKEST) * share).astype(np.uint8)


def voxel_colors(voxels: Voxels) -> np.ndarray:
    """N x 3 bytes: as the images show them, where that is known, else by height."""
    return height_colors(voxels.centers) if voxels.colors is None else seen_colors(voxels.colors)
