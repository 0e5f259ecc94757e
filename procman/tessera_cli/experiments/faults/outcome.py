"""What the runs of an experiment with faults came to: how each ended, and the pause after each fault."""

import json
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path

from tessera_cli.experiments.measurements import EXTRACTORS
from tessera_cli.files import write_text

FILE = "faults.json"
COMPLETE = "complete"


@dataclass(frozen=True)
class ThrownFault:
    """One that was thrown in a run."""

    process: str
    kind: str
    frame: int  # of the last pose before it
    began_s: float  # since the run's first pose
    ended_s: float
    pause_s: float | None  # the longest between two poses, of those that are attributed to it; None: no pose followed

    @property
    def kind_of_process(self) -> str:
        return EXTRACTORS if self.process.startswith("extractor_") else self.process


@dataclass(frozen=True)
class Outcome:
    """Of one run."""

    ended: str  # COMPLETE, or the sentence of its failure
    hashes: tuple[str, str]  # of trajectory and map; empty where there is none
    longest_pause_s: float  # between two poses
    faults: list[ThrownFault]

    def is_like(self, undisturbed: "Outcome") -> bool:
        """Ended well, with the same trajectory and map, bit for bit."""
        return self.ended == COMPLETE and self.hashes == undisturbed.hashes


def attribute_pauses(pose_times: Sequence[float], began: Sequence[float]) -> list[float | None]:
    """For each fault the longest pause between two poses that ends after it and before the next fault.

    `pose_times`, `began`: seconds, both ascending; the next fault is thrown only when poses come again. None where a
    fault has no such pose.
    """
    longest: list[float | None] = [None] * len(began)
    for last, pose in pairwise(pose_times):
        fault = bisect_right(began, pose) - 1
        if fault >= 0:
            longest[fault] = max(longest[fault] or 0.0, pose - last)
    return longest


def longest_pause(pose_times: Sequence[float]) -> float:
    return max((pose - last for last, pose in pairwise(pose_times)), default=0.0)


def write_outcome(folder: Path, outcome: Outcome) -> None:
    write_text(folder / FILE, json.dumps(asdict(outcome), indent=2) + "\n")


def read_outcome(folder: Path) -> Outcome | None:
    """None: the run has not been made yet."""
    try:
        found = json.loads((folder / FILE).read_text())
    except (OSError, ValueError):
        return None
    faults = [ThrownFault(**fault) for fault in found["faults"]]
    return Outcome(found["ended"], (found["hashes"][0], found["hashes"][1]), found["longest_pause_s"], faults)
