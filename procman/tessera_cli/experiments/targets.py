"""What is asked of speed and accuracy: ratios to one commit, and errors of the standard sequences."""

from dataclasses import dataclass
from decimal import Decimal

from tessera_cli.experiments.plan import Sequence

# The ratios are meant against this commit; against any other one there is none to reach.
BASELINE = "f1d2cc7"
# By sensor: frames per second at least, CPU time per frame at most, times those of the baseline.
SPEED = {"mono": "2.00", "stereo": "1.40", "rgbd": "3.30"}
CPU = {"mono": "0.50", "stereo": "0.50", "rgbd": "0.33"}

# Sources are relative to the folder of the data; errors [m] hold for whole sequences.
STANDARD = [
    Sequence("KITTI 03", "mono", "kitti:kitti/sequences/03", 0.66),
    Sequence("EuRoC MH_01", "stereo", "euroc:euroc/MH_01", 0.0045),
    Sequence("kitchen", "rgbd", "tum:rgbd/kitchen", 0.026),
    Sequence("street-short", "stereo", "sim:street-short", 0.023),
]


@dataclass(frozen=True)
class Target:
    """A number that a figure, or its ratio to the other commit, must reach."""

    limit: Decimal
    is_lower: bool  # values from it on are good; else values up to it
    is_ratio: bool

    @property
    def text(self) -> str:
        return f"{'≥' if self.is_lower else '≤'} {self.limit}{'x' if self.is_ratio else ''}"

    def is_met(self, value: float) -> bool:
        """The value counts with as many digits as the target has."""
        rounded = Decimal(value).quantize(self.limit)
        return rounded >= self.limit if self.is_lower else rounded <= self.limit


def speed_target(sequence: Sequence, against: str | None) -> Target | None:
    """`against`: the full hash of the other commit, if there is one."""
    return Target(Decimal(SPEED[sequence.sensor]), True, True) if _is_baseline(against) else None


def cpu_target(sequence: Sequence, against: str | None) -> Target | None:
    return Target(Decimal(CPU[sequence.sensor]), False, True) if _is_baseline(against) else None


def error_target(sequence: Sequence, is_whole: bool) -> Target | None:
    """`is_whole`: all of its frames were used."""
    if sequence.max_error_m is None or not is_whole:
        return None
    return Target(Decimal(str(sequence.max_error_m)), False, False)


def _is_baseline(against: str | None) -> bool:
    return against is not None and against.startswith(BASELINE)
