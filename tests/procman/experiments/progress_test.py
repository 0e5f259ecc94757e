"""How long the rest of an experiment will take."""

from tessera_cli.experiments.plan import THAT, THIS, Sequence, alternate
from tessera_cli.experiments.progress_view import time_left_s

FIRST, SECOND = Sequence("first", "mono", "kitti:/first"), Sequence("second", "mono", "kitti:/second")


def test_unknown_before_a_run_has_ended() -> None:
    assert time_left_s(alternate([FIRST], [THIS], 1), {}) is None


def test_runs_take_as_long_as_those_like_them() -> None:
    durations = {(FIRST.key, THIS): [10.0, 20.0], (FIRST.key, THAT): [40.0]}
    assert time_left_s(alternate([FIRST], [THIS, THAT], 1), durations) == 15.0 + 40.0


def test_else_as_those_of_the_sequence_else_as_any() -> None:
    assert time_left_s(alternate([FIRST], [THAT], 1), {(FIRST.key, THIS): [10.0]}) == 10.0
    assert time_left_s(alternate([SECOND], [THIS], 1), {(FIRST.key, THIS): [10.0]}) == 10.0


def test_nothing_is_left_at_the_end() -> None:
    assert time_left_s([], {}) == 0.0
