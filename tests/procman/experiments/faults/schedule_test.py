"""Which faults come in which order: a function of the seed, and every fault before one comes again."""

from itertools import islice

from tessera_cli.constants import FAULT_KINDS, FAULT_PROCESSES
from tessera_cli.experiments.faults.schedule import KILL, LOSS, NETWORK, SLOW, STOP, deck, schedule


def test_every_process_is_killed_and_stopped_but_only_extractors_are_slow() -> None:
    cards = deck(FAULT_PROCESSES, FAULT_KINDS, 2)
    for kind in (KILL, STOP):
        hit = [process for process, each in cards if each == kind]
        assert {"tracker", "mapper", "camera", "evaluator", "extractor_0", "extractor_1"} <= set(hit)
        assert len(hit) == len(set(hit)) == len(FAULT_PROCESSES) + 1
    assert [process for process, kind in cards if kind == SLOW] == ["extractor_0", "extractor_1"]
    assert {process for process, kind in cards if kind == LOSS} == {NETWORK}


def test_processes_and_kinds_can_be_chosen() -> None:
    assert deck(["mapper"], [KILL], 4) == [("mapper", KILL)]
    assert deck(["mapper"], [SLOW], 4) == []


def test_a_seed_always_gives_the_same_faults() -> None:
    cards = deck(FAULT_PROCESSES, FAULT_KINDS, 2)
    first = list(islice(schedule(1, cards), 100))
    assert first == list(islice(schedule(1, cards), 100))
    assert first != list(islice(schedule(2, cards), 100))


def test_all_come_before_one_comes_again_and_each_turn_has_its_own_order() -> None:
    cards = deck(FAULT_PROCESSES, FAULT_KINDS, 2)
    faults = schedule(5, cards)
    turns = [[(each.process, each.kind) for each in islice(faults, len(cards))] for _ in range(3)]
    for turn in turns:
        assert sorted(turn) == sorted(cards)
    assert turns[0] != turns[1]


def test_only_a_kill_has_no_end() -> None:
    for fault in islice(schedule(1, deck(FAULT_PROCESSES, FAULT_KINDS, 1)), 60):
        assert fault.wait_s > 0 and (fault.duration_s == 0) == (fault.kind == KILL)
