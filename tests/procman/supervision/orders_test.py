"""Who is obeyed: orders that a trusted key signed for this deputy since its start, each once; others are counted."""

import random

from helpers.orders import KEY, bad_order, make_order, make_verifier
from tessera_cli.supervision.signatures import SIGNATURE_BYTES, sign


def test_a_signed_fresh_order_passes_with_its_content() -> None:
    verifier = make_verifier()
    order = verifier.accept(sign(make_order(verifier), KEY))
    assert order is not None and order.wishes[0].name == "camera"
    assert verifier.num_accepted == 1 and not verifier.refused


def test_numbers_only_grow() -> None:
    verifier = make_verifier()
    for number, passes in ((5, True), (5, False), (4, False), (6, True)):
        assert (verifier.accept(sign(make_order(verifier, number), KEY)) is not None) == passes
    assert verifier.refused == {"replayed": 2}


def test_orders_of_an_earlier_life_of_the_deputy_are_stale() -> None:
    earlier, verifier = make_verifier(), make_verifier()
    assert verifier.accept(sign(make_order(earlier, 99), KEY)) is None
    assert verifier.refused == {"stale": 1}


def test_orders_for_other_deputies_are_theirs() -> None:
    verifier = make_verifier()
    assert verifier.accept(sign(make_order(verifier, deputy="node2"), KEY)) is None
    assert verifier.num_for_others == 1 and not verifier.refused


def test_a_signature_of_something_else_is_none_of_an_order() -> None:
    verifier = make_verifier()
    signed = sign(make_order(verifier), KEY)[:-SIGNATURE_BYTES]
    assert verifier.accept(signed + KEY.sign(signed).signature) is None
    assert verifier.refused == {"forged": 1}


def test_every_single_changed_bit_is_noticed() -> None:
    verifier = make_verifier()
    data = sign(make_order(verifier), KEY)
    for position in range(len(data)):
        changed = bytearray(data)
        changed[position] ^= 1 << position % 8
        assert verifier.accept(bytes(changed)) is None
    assert sum(verifier.refused.values()) == len(data) and verifier.accept(data) is not None


def test_of_a_thousand_bad_orders_none_is_obeyed_and_all_are_counted() -> None:
    verifier = make_verifier()
    obeyed = [sign(make_order(verifier, number), KEY) for number in range(1, 6)]
    assert all(verifier.accept(data) for data in obeyed)
    randomness = random.Random(6)
    for _ in range(1000):
        assert verifier.accept(bad_order(verifier, obeyed, randomness)) is None
    assert verifier.num_accepted == len(obeyed) and verifier.last_number == len(obeyed)
    assert sum(verifier.refused.values()) == 1000
    assert set(verifier.refused) == {"malformed", "unsigned", "unknown key", "forged", "stale", "replayed"}
