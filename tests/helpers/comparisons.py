"""Measurements of runs that nobody made."""

from typing import Any

from tessera_cli.experiments.measurements import Measurement
from tessera_cli.experiments.plan import Sequence
from tessera_cli.experiments.tables import Comparison
from tessera_cli.experiments.targets import BASELINE

BASELINE_COMMIT = BASELINE + "0" * (40 - len(BASELINE))
SEQUENCE = Sequence("a drive", "mono", "kitti:/a/drive", max_error_m=0.66)


def make_measurement(**changes: Any) -> Measurement:
    values: dict[str, Any] = {
        "frames": 801,
        "frames_per_s": 40.0,
        "cpu_ms": {"camera": 4.0, "extractors": 8.0, "tracker": 4.0, "mapper": 16.0, "evaluator": 0.01},
        "busy_ms": {"mapper": 20.0, "tracker": 5.0},
        "keyframes": 330,
        "error_m": 0.6612,
        "latency_median_ms": 150.0,
        "latency_p95_ms": 230.0,
        "map_wait_ms": 18.3,
        "hashes": ("ab" * 32, "cd" * 32),
    }
    return Measurement(**{**values, **changes})


def make_comparison(this: list[Measurement], that: list[Measurement], **changes: Any) -> Comparison:
    values: dict[str, Any] = {
        "sequence": SEQUENCE,
        "cores": 2,
        "is_whole": True,
        "against": BASELINE_COMMIT if that else None,
    }
    return Comparison(this=this, that=that, **{**values, **changes})
