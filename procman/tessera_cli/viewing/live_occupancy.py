"""The occupancy map of a running stack, from its OCCUPANCY messages.

It is shown region by region, so that only what changed is sent to the viewer. A listener may miss messages: where their
numbers have a gap, and at the start, the whole map is wanted.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from tessera_cli.maps.colors import height_bounds, height_colors
from tessera_cli.maps.map_follower import PartJoiner
from tessera_cli.viewing.scene import VOXELS, Shown, Voxels

BLOCK_SIDE, REGION_SIDE = 16, 4  # voxels, blocks
OCCUPIED = 2
STATE_BITS = np.arange(0, 8, 2, dtype=np.uint8)  # where the states of a byte begin
# Colors are chosen anew when the heights have grown by so much of their range.
MAX_DRIFT = 0.1

Place = tuple[int, int, int]


class LiveOccupancy:
    def __init__(self) -> None:
        self.lacks_whole = True
        self._joiner = PartJoiner()
        self._last_number = -1
        self._resolution = 0.0
        # Of each block that has some, n x 3: numbers of the voxels that are occupied.
        self._blocks: dict[Place, np.ndarray] = {}
        self._changed: set[Place] = set()  # regions
        self._bounds: tuple[float, float] | None = None  # heights between which the colors change

    def on_update(self, message: Any) -> None:
        """An occupancy_t."""
        parts = self._joiner.add(message.number, message)
        if parts is None:
            return
        if message.is_whole:
            self._changed |= {_region_of(place) for place in self._blocks}
            self._blocks.clear()
        self.lacks_whole = not message.is_whole and (self.lacks_whole or message.number != self._last_number + 1)
        self._last_number, self._resolution = message.number, message.resolution
        for part in parts:
            for block in part.blocks:
                self._set(block)

    def _set(self, block: Any) -> None:
        place = (int(block["x"]), int(block["y"]), int(block["z"]))
        states = (block["states"][:, None] >> STATE_BITS & 3).ravel()
        numbers = np.flatnonzero(states == OCCUPIED)
        self._changed.add(_region_of(place))
        if len(numbers):
            within = [numbers % BLOCK_SIDE, numbers // BLOCK_SIDE % BLOCK_SIDE, numbers // BLOCK_SIDE**2]
            self._blocks[place] = np.stack(within, axis=1) + BLOCK_SIDE * np.array(place)
        else:
            self._blocks.pop(place, None)

    def shapes(self) -> Iterator[Shown]:
        """The regions that changed since the last call."""
        if not self._changed:
            return
        regions: dict[Place, list[np.ndarray]] = {region: [] for region in self._changed}
        if self._have_heights_grown():
            regions |= {_region_of(place): [] for place in self._blocks}
        for place, cells in self._blocks.items():
            if (region := _region_of(place)) in regions:
                regions[region].append(cells)
        for region, parts in regions.items():
            cells = np.concatenate([np.empty((0, 3), int), *parts])
            centers = (cells + 0.5) * self._resolution
            path = "/".join([VOXELS, "_".join(map(str, region))])
            sizes = np.full(len(centers), self._resolution)
            yield Voxels(path, centers, sizes, height_colors(centers, self._bounds))
        self._changed.clear()

    def _have_heights_grown(self) -> bool:
        if not self._blocks:
            return False
        centers = (np.array(list(self._blocks)) + 0.5) * BLOCK_SIDE * self._resolution
        low, high = height_bounds(centers)
        if self._bounds is not None:
            drift = max(abs(low - self._bounds[0]), abs(high - self._bounds[1]))
            if drift <= MAX_DRIFT * (self._bounds[1] - self._bounds[0]):
                return False
        has_changed = self._bounds != (low, high)
        self._bounds = (low, high)
        return has_changed


def _region_of(block: Place) -> Place:
    x, y, z = block
    return x // REGION_SIDE, y // REGION_SIDE, z // REGION_SIDE
