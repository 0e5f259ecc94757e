"""What is claimed of distribution is judged by medians of what was measured."""

from helpers.made_distribution import make_figures, make_outcome
from tessera_cli.experiments.distribution.claims import Claim, check_claims
from tessera_cli.experiments.distribution.figures import Figures
from tessera_cli.experiments.distribution.grid import ALONE, HETEROGENEOUS, KILLED, SINGLE, Configuration


def find(claims: list[Claim], words: str) -> Claim:
    (found,) = [claim for claim in claims if words in claim.text]
    return found


def test_slow_nodes_scale() -> None:
    runs = {
        Configuration(1, "1x1"): [make_figures(5.0)],
        Configuration(8, "1x1"): [make_figures(speed) for speed in (36.0, 40.0, 20.0)],
        Configuration(16, "1x1"): [make_figures(60.0)],
    }
    claims = check_claims(make_outcome(HETEROGENEOUS, runs))
    eight, sixteen = find(claims, "8 slow nodes"), find(claims, "16 slow nodes")
    assert eight.is_met and eight.measured == "0.90 x 8"
    assert not sixteen.is_met and sixteen.measured == "0.75 x 16"
    assert sixteen.sentence.startswith("MISSED: 16 slow nodes")


def test_latency_falls_with_the_cut() -> None:
    runs = {
        Configuration(1, "1x1", ALONE): [make_figures(latency_ms=200.0)],
        Configuration(4, "2x2", ALONE): [make_figures(latency_ms=79.0)],
    }
    claim = find(check_claims(make_outcome(HETEROGENEOUS, {**runs, Configuration(1, "1x1"): [make_figures()]})), "2x2")
    assert claim.is_met and claim.measured == "79 of 200 ms, 0.40"


def test_traffic_counts_both_directions_of_the_first_link() -> None:
    runs = {
        Configuration(4, "1x1"): [make_figures(sent=400_000)],
        Configuration(4, "2x8"): [make_figures(sent=900_000)],
    }
    claim = find(check_claims(make_outcome(HETEROGENEOUS, runs)), "traffic")
    assert not claim.is_met and claim.measured == "2.00 x"


def test_the_estimating_host_is_all_but_extractors() -> None:
    outcome = make_outcome(SINGLE, {Configuration(1, "1x1"): [make_figures()]})
    claim = find(check_claims(outcome), "10 Hz")
    assert claim.is_met and claim.measured == "0.20 to 0.20"  # 4 + 16 ms ten times a second


def test_what_passes_between_frames_that_come_slowly_is_not_counted_ten_times() -> None:
    """A frame costs 30 ms, and each second 50 ms, whether frames come or not."""

    def of_rate(frames_per_s: float) -> list[Figures]:
        return [
            make_figures(frames_per_s=frames_per_s, cpu_ms={"extractors": 8.0, "mapper": 30.0 + 50.0 / frames_per_s})
        ]

    outcome = make_outcome(
        HETEROGENEOUS, {Configuration(1, "2x2"): of_rate(1.0), Configuration(8, "2x2"): of_rate(8.0)}
    )
    assert find(check_claims(outcome), "10 Hz").measured == "0.35 to 0.35"


def test_a_run_with_another_result_is_told() -> None:
    other = make_figures(hashes=("ef" * 32, "cd" * 32))
    runs = {Configuration(4, "2x2"): [make_figures()] * 2, Configuration(4, "2x2", KILLED): [other]}
    claims = check_claims(make_outcome(SINGLE, runs))
    assert not find(claims, "one trajectory").is_met
    assert not find(claims, "killed").is_met
    assert find(claims, "no tracking failure").is_met
