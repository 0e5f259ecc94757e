"""The occupancy map of a running stack, from its OCCUPANCY messages.

It is shown region by region, so that only what changed is sent to the viewer. A listener may miss messages: where their
numbers have a gap, and at the start, the whole map is wanted. Voxels show what the images do, where that is told, and
their height where the whole run is gray.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from tessera_cli.maps.colors import height_bounds, height_colors, seen_bounds, seen_colors
from tessera_cli.maps.map_follower import PartJoiner
from tessera_cli.viewing.scene import VOXELS, Shown, Voxels

BLOCK_SIDE, REGION_SIDE = 16, 4  # voxels, blocks
OCCUPIED = 2
STATE_BITS = np.arange(0, 8, 2, dtype=np.uint8)  # where the states of a byte begin
# Colors are chosen anew when the heights, or brightnesses, have grown by so much of their range.
MAX_DRIFT = 0.1
UNKNOWN_COLOR = 128  # gray; of voxels that were told before any color was

Place = tuple[int, int, int]


class LiveOccupancy:
    def __init__(self) -> None:
        self.lacks_whole = True
        self._joiner = PartJoiner()
        self._last_number = -1
        self._resolution = 0.0
        # Of each block that has some, n x 3: numbers of the voxels that are occupied.
        self._blocks: dict[Place, np.ndarray] = {}
        self._colors: dict[Place, np.ndarray] = {}  # likewise, n x 3 bytes: their colors, where they are known
        self._changed: set[Place] = set()  # regions
        self._is_colored = False
        self._bounds: tuple[float, float] | None = None  # heights, or brightnesses, between which the colors change

    def on_update(self, message: Any) -> None:
        """An occupancy_t."""
        parts = self._joiner.add(message.number, message)
        if parts is None:
            return
        if message.is_whole:
            self._changed |= {_region_of(place) for place in self._blocks}
            self._blocks.clear()
            self._colors.clear()
        self.lacks_whole = not message.is_whole and (self.lacks_whole or message.number != self._last_number + 1)
        self._last_number, self._resolution = message.number, message.resolution
        places = [self._set(block) for part in parts for block in part.blocks]
        colors = np.concatenate([np.empty((0, 3), np.uint8), *[_bytes_of(part.colors) for part in parts]])
        sizes = [len(self._blocks.get(place, ())) for place in places]
        if 0 < len(colors) == sum(sizes):
            self._colors |= zip(places, np.split(colors, np.cumsum(sizes)[:-1]))

    def _set(self, block: Any) -> Place:
        """Without colors."""
        place = (int(block["x"]), int(block["y"]), int(block["z"]))
        states = (block["states"][:, None] >> STATE_BITS & 3).ravel()
        numbers = np.flatnonzero(states == OCCUPIED)
        self._changed.add(_region_of(place))
        self._colors.pop(place, None)
        if len(numbers):
            within = [numbers % BLOCK_SIDE, numbers // BLOCK_SIDE % BLOCK_SIDE, numbers // BLOCK_SIDE**2]
            self._blocks[place] = np.stack(within, axis=1) + BLOCK_SIDE * np.array(place)
        else:
            self._blocks.pop(place, None)
        return place

    def shapes(self) -> Iterator[Shown]:
        """The regions that changed since the last call."""
        if not self._changed:
            return
        regions: dict[Place, list[Place]] = {region: [] for region in self._changed}
        if self._must_color_anew():
            regions |= {_region_of(place): [] for place in self._blocks}
        for place in self._blocks:
            if (region := _region_of(place)) in regions:
                regions[region].append(place)
        for region, places in regions.items():
            cells = np.concatenate([np.empty((0, 3), int), *[self._blocks[place] for place in places]])
            centers = (cells + 0.5) * self._resolution
            path = "/".join([VOXELS, "_".join(map(str, region))])
            sizes = np.full(len(centers), self._resolution)
            yield Voxels(path, centers, sizes, self._look_of(places, centers))
        self._changed.clear()

    def _look_of(self, places: list[Place], centers: np.ndarray) -> np.ndarray:
        """N x 3 bytes: the colors of the n voxels of these blocks, which have these centers."""
        if not self._is_colored:
            return height_colors(centers, self._bounds)
        unknown = [np.full((len(self._blocks[place]), 3), UNKNOWN_COLOR, np.uint8) for place in places]
        known = [self._colors.get(place, gray) for place, gray in zip(places, unknown)]
        return seen_colors(np.concatenate([np.empty((0, 3), np.uint8), *known]), self._bounds)

    def _must_color_anew(self) -> bool:
        """Also what did not change: other heights or brightnesses occur than before, or there are colors now."""
        if not self._blocks:
            return False
        was_colored, self._is_colored = self._is_colored, bool(self._colors)
        if self._is_colored:
            low, high = seen_bounds(np.concatenate(list(self._colors.values())))
        else:
            low, high = height_bounds((np.array(list(self._blocks)) + 0.5) * BLOCK_SIDE * self._resolution)
        if self._bounds is not None and was_colored == self._is_colored:
            drift = max(abs(low - self._bounds[0]), abs(high - self._bounds[1]))
            if drift <= MAX_DRIFT * (self._bounds[1] - self._bounds[0]):
                return False
        has_changed = was_colored != self._is_colored or self._bounds != (low, high)
        self._bounds = (low, high)
        return has_changed


def _bytes_of(colors: np.ndarray) -> np.ndarray:
    """N x 3 of n rgb_t."""
    return np.stack([colors["red"], colors["green"], colors["blue"]], axis=1)


def _region_of(block: Place) -> Place:
    x, y, z = block
    return x // REGION_SIDE, y // REGION_SIDE, z // REGION_SIDE
