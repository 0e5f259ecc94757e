"""What is varied, and what each configuration asks of the stack."""

import pytest

from tessera_cli.errors import UserError
from tessera_cli.experiments.distribution.grid import (
    ALONE,
    EXPERIMENTS,
    HETEROGENEOUS,
    HOMOGENEOUS,
    KILLED,
    LOSS,
    SINGLE,
    Configuration,
    check_extractors,
    fault_grid,
    latency_grid,
    read_key,
    throughput_grid,
)


def test_slow_nodes_are_four_to_a_host_on_slow_links() -> None:
    assert [HETEROGENEOUS.num_hosts(number) for number in (1, 4, 8, 16)] == [2, 2, 3, 5]
    assert HETEROGENEOUS.link_rates_mbit(8) == [1000.0, 100.0, 100.0]
    assert HOMOGENEOUS.link_rates_mbit(4) == [1000.0, 1000.0]
    assert SINGLE.link_rates_mbit(4) == [None]


def test_every_standard_number_of_extractors_fits_the_hosts() -> None:
    for experiment in EXPERIMENTS.values():
        check_extractors(experiment, experiment.extractors)
    with pytest.raises(UserError, match=r"6.*multiple of 4"):
        check_extractors(HETEROGENEOUS, [4, 6])


def test_folders_are_named_after_configurations() -> None:
    for configuration in (Configuration(4, "2x2"), Configuration(16, "2x8", ALONE), Configuration(1, "1x1", LOSS)):
        assert read_key(configuration.key) == configuration
    assert read_key("this") is None


def test_enough_frames_are_on_their_way_to_keep_all_extractors_busy() -> None:
    assert Configuration(16, "1x1").window >= 2 * 16
    assert Configuration(16, "2x8", ALONE).window == 1


def test_all_cuts_meet_all_numbers_of_extractors() -> None:
    assert {each.key for each in throughput_grid([1, 2], ["1x1", "2x2"])} == {"p1_1x1", "p2_1x1", "p1_2x2", "p2_2x2"}


def test_one_frame_at_a_time_needs_no_more_extractors_than_tiles() -> None:
    grid = latency_grid([1, 2, 4, 8], ["1x1", "2x2"])
    assert [(each.tiles, each.extractors) for each in grid] == [
        ("1x1", 1),
        ("1x1", 2),  # shows that it is of no use
        ("2x2", 1),
        ("2x2", 2),
        ("2x2", 4),
        ("2x2", 8),
    ]


def test_faults_meet_the_finest_distribution() -> None:
    assert fault_grid([1, 4, 2], ["2x4", "1x1"]) == [Configuration(4, "2x4", KILLED), Configuration(4, "2x4", LOSS)]
