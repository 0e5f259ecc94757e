"""What the three distribution experiments vary: number of extractors, cuts, hosts and their speed."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from tessera_cli.errors import UserError

FASTEST_LINK_MBIT = 1000.0
# Frames on their way at once, in lockstep: two jobs for each extractor keep all busy, and the pipeline wants some.
MIN_WINDOW = 6
ALONE = "alone"  # one frame at a time: the latency of a frame that waits for no other
KILLED = "killed"
LOSS = "loss"


@dataclass(frozen=True)
class Experiment:
    """One of the paper's three."""

    name: str
    summary: str
    extractors: tuple[int, ...]  # by default
    cuts: tuple[str, ...]  # by default
    extractors_per_host: int  # 0: they share the first host with all other stages
    link_mbit: float | None  # of the hosts of extractors
    is_slow: bool = False  # extractors get a share of a core each

    def num_hosts(self, extractors: int) -> int:
        return 1 + (-(-extractors // self.extractors_per_host) if self.extractors_per_host else 0)

    def link_rates_mbit(self, extractors: int) -> list[float | None]:
        """Of all hosts; the first one's is the fastest that boards and PCs have."""
        others = self.num_hosts(extractors) - 1
        return [FASTEST_LINK_MBIT if others else None, *[self.link_mbit] * others]


SINGLE = Experiment(
    "single",
    "P extractors on one machine, images cut into L x C tiles.",
    extractors=(1, 2, 3, 4),
    cuts=("1x1", "2x1", "2x2", "2x4"),
    extractors_per_host=0,
    link_mbit=None,
)
HOMOGENEOUS = Experiment(
    "homogeneous",
    "P extractors on a second host of the same speed, 1 Gbit/s.",
    extractors=(1, 2, 3, 4),
    cuts=("1x1", "2x1", "2x2", "2x4"),
    extractors_per_host=256,
    link_mbit=FASTEST_LINK_MBIT,
)
HETEROGENEOUS = Experiment(
    "heterogeneous",
    "P slow nodes, four to a host, 100 Mbit/s: each is held to a share of a core.",
    extractors=(1, 2, 4, 8, 16),
    cuts=("1x1", "2x1", "2x2", "2x4", "2x8"),
    extractors_per_host=4,
    link_mbit=100.0,
    is_slow=True,
)
EXPERIMENTS = {each.name: each for each in (SINGLE, HOMOGENEOUS, HETEROGENEOUS)}


@dataclass(frozen=True)
class Configuration:
    """How one run distributes its work."""

    extractors: int
    tiles: str  # LINESxCOLUMNS
    variant: str = ""  # ALONE, KILLED, LOSS; empty: as fast as it goes

    @property
    def key(self) -> str:
        """Of its folder."""
        return f"p{self.extractors}_{self.tiles}" + (f"_{self.variant}" if self.variant else "")

    @property
    def num_tiles(self) -> int:
        return tile_count(self.tiles)

    @property
    def window(self) -> int:
        """Frames on their way at once."""
        return 1 if self.variant == ALONE else max(MIN_WINDOW, 2 * self.extractors + 2)


def read_key(key: str) -> Configuration | None:
    """Of `Configuration.key`; None if it is none."""
    match = re.fullmatch(rf"p(\d+)_(\d+x\d+)(?:_({ALONE}|{KILLED}|{LOSS}))?", key)
    return Configuration(int(match[1]), match[2], match[3] or "") if match else None


def tile_count(tiles: str) -> int:
    lines, columns = tiles.split("x")
    return int(lines) * int(columns)


def check_extractors(experiment: Experiment, extractors: Sequence[int]) -> None:
    """Raises UserError where a host would have fewer than the others."""
    per_host = experiment.extractors_per_host
    for number in extractors:
        if per_host and number > per_host and number % per_host:
            raise UserError(f"--extractors {number}: more than {per_host} must be a multiple of {per_host}.")


def throughput_grid(extractors: Sequence[int], cuts: Sequence[str]) -> list[Configuration]:
    return [Configuration(number, tiles) for tiles in cuts for number in extractors]


def latency_grid(extractors: Sequence[int], cuts: Sequence[str]) -> list[Configuration]:
    """One frame at a time is of no use to more extractors than it has tiles; the next larger number shows that."""
    chosen = []
    for tiles in cuts:
        useful = [number for number in extractors if number <= tile_count(tiles)]
        larger = [number for number in extractors if number > tile_count(tiles)]
        chosen += [Configuration(number, tiles, ALONE) for number in useful + larger[:1]]
    return chosen


def fault_grid(extractors: Sequence[int], cuts: Sequence[str]) -> list[Configuration]:
    """Where work is spread most finely: a node that ends in the middle of a run, and lost packets."""
    return [Configuration(max(extractors), max(cuts, key=tile_count), variant) for variant in (KILLED, LOSS)]
