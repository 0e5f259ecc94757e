"""Which faults are thrown in which order: a function of a seed alone.

The faults of an experiment are shuffled like a deck of cards: before one comes again, all others have come.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random

from tessera_cli.constants import FAULT_KINDS

KILL, STOP, SLOW, LOSS = FAULT_KINDS
# Those that only root can make: a control group, and a network namespace.
ROOT_KINDS = (SLOW, LOSS)
# Where packets are lost.
NETWORK = "network"
# As FAULT_PROCESSES has it.
EXTRACTOR = "extractor"
# From a pose that shows that the run goes on after the fault before, to the next fault.
WAIT_S = (0.3, 2.0)
# Of faults that have an end.
DURATION_S = (1.0, 6.0)
# Losses in a deck: there is one network, but many processes.
LOSSES = 2


@dataclass(frozen=True)
class Fault:
    """One that is to be thrown."""

    process: str  # or NETWORK
    kind: str
    wait_s: float
    duration_s: float  # 0: it has no end


def deck(processes: Sequence[str], kinds: Sequence[str], extractors: int) -> list[tuple[str, str]]:
    """Each process with each kind of fault. `processes`: of PROCESSES."""
    all_extractors = [f"{EXTRACTOR}_{number}" for number in range(extractors)]
    names = [name for each in processes for name in (all_extractors if each == EXTRACTOR else [each])]
    targets = {
        KILL: names,
        STOP: names,
        SLOW: all_extractors if EXTRACTOR in processes else [],
        LOSS: [NETWORK] * LOSSES,
    }
    return [(process, kind) for kind in kinds for process in targets[kind]]


def schedule(seed: int, cards: Sequence[tuple[str, str]]) -> Iterator[Fault]:
    """Without end. `cards`: those of `deck`, at least one."""
    turn = 0
    while True:
        generator = Random(f"{seed} {turn}")
        shuffled = list(cards)
        generator.shuffle(shuffled)
        for process, kind in shuffled:
            wait_s, duration_s = generator.uniform(*WAIT_S), generator.uniform(*DURATION_S)
            yield Fault(process, kind, round(wait_s, 2), 0.0 if kind == KILL else round(duration_s, 2))
        turn += 1
