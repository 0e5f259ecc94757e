"""How large a share of a core makes a node as slow as asked for."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from tessera_cli.errors import UserError
from tessera_cli.files import write_text

# Close enough; and so many attempts, since a busy machine measures something else each time.
TOLERANCE = 0.05
MAX_ATTEMPTS = 4


@dataclass(frozen=True)
class Calibration:
    """Of all slow nodes."""

    share: float  # of a core, for each node
    full_step_ms: float  # extraction of one whole image with a core of its own
    step_ms: float  # with the share


def calibrate(measure_ms: Callable[[float], float], target_ms: float) -> Calibration:
    """`measure_ms`: the time of one whole image at a share of a core, 1: all of it.

    The time is nearly that of the whole core divided by the share, so that a few corrections suffice; the best attempt
    counts. Raises UserError if a whole core is slower than the target.
    """
    full_ms = measure_ms(1.0)
    if full_ms >= target_ms:
        raise UserError(
            f"--step-ms {target_ms:g}: a whole core of this machine takes {full_ms:.0f} ms for an image; ask for more."
        )
    share = full_ms / target_ms
    attempts = []
    for _ in range(MAX_ATTEMPTS):
        attempts.append(Calibration(share, full_ms, measure_ms(share)))
        if abs(attempts[-1].step_ms / target_ms - 1) <= TOLERANCE:
            break
        share = min(1.0, share * attempts[-1].step_ms / target_ms)
    return min(attempts, key=lambda each: abs(each.step_ms - target_ms))


def check_room(calibration: Calibration, num_nodes: int, cores: int) -> str:
    """A sentence about what all nodes together may use. Raises UserError if it is all that the machine has, or more."""
    used = num_nodes * calibration.share
    if used >= cores:
        raise UserError(
            f"{num_nodes} nodes with {calibration.share:.3f} of a core each need {used:.2f} cores, and this machine "
            f"has {cores}: ask for slower nodes (--step-ms) or fewer (--extractors)."
        )
    return (
        f"A slow node has {100 * calibration.share:.1f} % of a core: a whole image takes {calibration.step_ms:.0f} ms "
        f"instead of {calibration.full_step_ms:.1f} ms. {num_nodes} of them may use {used:.2f} of {cores} cores; "
        f"{cores - used:.2f} are left for the estimating host and the kernel."
    )


def write_calibration(calibration: Calibration, path: Path) -> None:
    write_text(path, json.dumps(asdict(calibration), indent=2) + "\n")


def read_calibration(path: Path) -> Calibration | None:
    try:
        return Calibration(**json.loads(path.read_text()))
    except (OSError, ValueError, TypeError):
        return None
