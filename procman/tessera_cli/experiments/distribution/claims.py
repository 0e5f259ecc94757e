"""What is claimed of distribution, and whether an experiment shows it."""

import math
from dataclasses import dataclass

import numpy as np

from tessera_cli.experiments.distribution.figures import Cell
from tessera_cli.experiments.distribution.grid import ALONE, KILLED, LOSS
from tessera_cli.experiments.distribution.outcome import Outcome

# Of P times one slow node's speed, by P.
SCALING = {8: 0.90, 16: 0.85}
MAX_LATENCY_RATIO = 0.4  # of an image in 2x2 tiles on four slow nodes, to a whole one on one
MAX_WIRE_RATIO = 1.3  # of 2x8 tiles to whole images
MAX_HOST_CORES = 0.5  # at 10 Hz


@dataclass(frozen=True)
class Claim:
    """A sentence with what was measured."""

    text: str
    measured: str
    is_met: bool

    @property
    def sentence(self) -> str:
        return f"{'met' if self.is_met else 'MISSED'}: {self.text}: {self.measured}"


def check_claims(outcome: Outcome) -> list[Claim]:
    """Those for which there are runs."""
    found = [_failures(outcome), _one_hash(outcome), *_scaling(outcome), _latency(outcome), _wire(outcome)]
    found += [_host_cpu(outcome), *_faults(outcome)]
    return [claim for claim in found if claim]


def _failures(outcome: Outcome) -> Claim:
    failures = sum(run.failures for cell in outcome.cells.values() for run in cell.runs)
    return Claim("no tracking failure, however images are cut", f"{failures} in all runs", failures == 0)


def _one_hash(outcome: Outcome) -> Claim:
    runs = sum(len(cell.runs) for cell in outcome.cells.values())
    results = len(outcome.hashes)
    measured = f"{runs} runs, all equal" if results == 1 else f"{runs} runs, {results} different results"
    return Claim("one trajectory and one map, bit for bit", measured, results == 1)


def _speed(cell: Cell | None) -> float:
    return cell.median(lambda run: run.poses_per_s) if cell else math.nan


def _scaling(outcome: Outcome) -> list[Claim]:
    """Whole images: the way to throughput."""
    if not outcome.experiment.is_slow:
        return []
    claims = []
    one = _speed(outcome.cell(1, "1x1"))
    for number, wanted in SCALING.items():
        share = _speed(outcome.cell(number, "1x1")) / (number * one)
        if not math.isnan(share):
            text = f"{number} slow nodes are at least {wanted:.2f} x {number} times as fast as one"
            claims.append(Claim(text, f"{share:.2f} x {number}", share >= wanted))
    return claims


def _median_latency(cell: Cell | None) -> float:
    return float(np.median(np.concatenate([run.latencies_ms for run in cell.runs]))) if cell else math.nan


def _latency(outcome: Outcome) -> Claim | None:
    whole = _median_latency(outcome.cell(1, "1x1", ALONE))
    cut = _median_latency(outcome.cell(4, "2x2", ALONE))
    if not outcome.experiment.is_slow or math.isnan(whole) or math.isnan(cut):
        return None
    text = f"latency of a frame in 2x2 tiles on four nodes at most {MAX_LATENCY_RATIO} of a whole one on one"
    return Claim(text, f"{cut:.0f} of {whole:.0f} ms, {cut / whole:.2f}", cut / whole <= MAX_LATENCY_RATIO)


def _wire(outcome: Outcome) -> Claim | None:
    number = max(outcome.extractors)
    whole, cut = outcome.cell(number, "1x1"), outcome.cell(number, "2x8")
    if not whole or not cut:
        return None
    ratio = cut.median(lambda run: run.wire_kb) / whole.median(lambda run: run.wire_kb)
    text = f"traffic of 2x8 tiles at most {MAX_WIRE_RATIO} x that of whole images"
    return Claim(text, f"{ratio:.2f} x", ratio <= MAX_WIRE_RATIO)


def _host_cpu(outcome: Outcome) -> Claim:
    cores = [outcome.host_cores_at_10_hz(cell) for cell in outcome.of_variant("")]
    text = f"the estimating host needs at most {MAX_HOST_CORES} cores at 10 Hz"
    return Claim(text, f"{min(cores):.2f} to {max(cores):.2f}", max(cores) <= MAX_HOST_CORES)


def _faults(outcome: Outcome) -> list[Claim]:
    names = {KILLED: "a node killed in the middle", LOSS: "2 % of the packets lost in the middle"}
    claims = []
    for variant, name in names.items():
        for cell in outcome.of_variant(variant):
            same = outcome.cell(cell.configuration.extractors, cell.configuration.tiles)
            if same:
                lost = f", {max(run.repaired for run in cell.runs)} messages repaired"
                is_same = cell.hashes == same.hashes
                claims.append(Claim(f"{name}: same result", ("same" if is_same else "another one") + lost, is_same))
    return claims
