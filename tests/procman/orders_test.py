"""Who is obeyed: orders that a trusted key signed for this deputy since its start, each once. All others are counted."""

import random

import pytest
from nacl.signing import SigningKey

from tessera_cli.cluster.keys import KeyRing, to_text
from tessera_cli.errors import UserError
from tessera_cli.messages import procman_order_t, procman_wish_t
from tessera_cli.supervision.orders import KEY_BYTES, SIGNATURE_BYTES, Gate, sign

from deputies import own_keys  # noqa: F401, sets the path to tessera_cli too

KEY = SigningKey(bytes(range(32)))
OTHER_KEY = SigningKey(bytes(range(1, 33)))


def make_gate(deputy="node1"):
    return Gate(deputy, lambda: [KEY.verify_key.encode()])


def make_order(gate, number=1, **changes):
    order = procman_order_t()
    order.deputy, order.nonce, order.number = gate.deputy, gate.nonce, number
    order.order, order.action = "an order", procman_order_t.RUN
    wish = procman_wish_t()
    wish.name = wish.command = "camera"
    order.num_wishes, order.wishes = 1, [wish]
    for name, value in changes.items():
        setattr(order, name, value)
    return order


def test_a_signed_fresh_order_passes_with_its_content() -> None:
    gate = make_gate()
    order = gate.check(sign(make_order(gate), KEY))
    assert order.wishes[0].name == "camera" and gate.num_passed == 1 and not gate.refused


def test_numbers_only_grow() -> None:
    gate = make_gate()
    for number, passes in ((5, True), (5, False), (4, False), (6, True)):
        assert (gate.check(sign(make_order(gate, number), KEY)) is not None) == passes
    assert gate.refused == {"replayed": 2}


def test_orders_of_an_earlier_life_of_the_deputy_are_stale() -> None:
    earlier, gate = make_gate(), make_gate()
    assert gate.check(sign(make_order(earlier, 99), KEY)) is None
    assert gate.refused == {"stale": 1}


def test_orders_for_other_deputies_are_theirs() -> None:
    gate = make_gate()
    assert gate.check(sign(make_order(gate, deputy="node2"), KEY)) is None
    assert gate.num_for_others == 1 and not gate.refused


def test_a_signature_of_something_else_is_none_of_an_order() -> None:
    gate = make_gate()
    signed = sign(make_order(gate), KEY)[:-SIGNATURE_BYTES]
    assert gate.check(signed + KEY.sign(signed).signature) is None
    assert gate.refused == {"forged": 1}


def test_every_single_changed_bit_is_noticed() -> None:
    gate = make_gate()
    data = sign(make_order(gate), KEY)
    for position in range(len(data)):
        changed = bytearray(data)
        changed[position] ^= 1 << position % 8
        assert gate.check(bytes(changed)) is None
    assert sum(gate.refused.values()) == len(data) and gate.check(data) is not None


def bad_order(gate, obeyed: list[bytes], randomness: random.Random) -> bytes:
    """One of the ways to be no order, by turns."""
    good = sign(make_order(gate, number=1000 + randomness.randrange(1000)), KEY)
    match randomness.randrange(8):
        case 0:  # forged: another's words under a trusted key
            return good[:-SIGNATURE_BYTES] + randomness.randbytes(SIGNATURE_BYTES)
        case 1:  # replayed
            return randomness.choice(obeyed)
        case 2:  # unsigned
            return good[:-SIGNATURE_BYTES] + bytes(SIGNATURE_BYTES)
        case 3:  # truncated
            return good[: randomness.randrange(len(good))]
        case 4:  # signed by a stranger
            return sign(make_order(gate, number=5000), OTHER_KEY)
        case 5:  # a stranger's signature beside a trusted key
            stranger = sign(make_order(gate, number=5000), OTHER_KEY)
            return stranger[: -SIGNATURE_BYTES - KEY_BYTES] + KEY.verify_key.encode() + stranger[-SIGNATURE_BYTES:]
        case 6:  # of an earlier life
            return sign(make_order(gate, number=5000, nonce=randomness.randbytes(16)), KEY)
    return randomness.randbytes(randomness.randrange(2000))  # noise


def test_of_a_thousand_bad_orders_none_is_obeyed_and_all_are_counted() -> None:
    gate = make_gate()
    obeyed = [sign(make_order(gate, number), KEY) for number in range(1, 6)]
    assert all(gate.check(data) for data in obeyed)
    randomness = random.Random(6)
    for _ in range(1000):
        assert gate.check(bad_order(gate, obeyed, randomness)) is None
    assert gate.num_passed == len(obeyed) and gate.last_number == len(obeyed)
    assert sum(gate.refused.values()) == 1000
    assert set(gate.refused) == {"malformed", "unsigned", "unknown key", "forged", "stale", "replayed"}


def test_the_own_key_is_made_and_trusted_at_once(own_keys) -> None:
    ring = KeyRing(own_keys)
    assert list(ring.trusted().values()) == [ring.signing_key().verify_key.encode()]
    assert ring.secret_path.stat().st_mode & 0o777 == 0o600
    assert KeyRing(own_keys).signing_key() == ring.signing_key()


def test_a_new_key_replaces_the_own_one_and_keeps_the_others(own_keys) -> None:
    ring = KeyRing(own_keys)
    ring.trust("base", to_text(OTHER_KEY.verify_key.encode()))
    old = ring.signing_key()
    ring.make()
    assert ring.signing_key() != old
    assert set(ring.trusted().values()) == {ring.signing_key().verify_key.encode(), OTHER_KEY.verify_key.encode()}
    ring.revoke("base")
    assert list(ring.trusted()) == ["me"]


def test_faults_of_keys_are_named(own_keys) -> None:
    ring = KeyRing(own_keys)
    for name, key, words in (("a b", "", "letters"), ("a", "%", "base64"), ("a", "AAAA", "3 bytes instead of 32")):
        with pytest.raises(UserError, match=words):
            ring.trust(name, key)
    with pytest.raises(UserError, match="no key of the name"):
        ring.revoke("nobody")
    ring.trusted_path.write_text("one two three\n")
    with pytest.raises(UserError, match="trusted_keys:1"):
        ring.trusted()
    ring.secret_path.chmod(0o644)
    with pytest.raises(UserError, match="chmod 600"):
        ring.signing_key()
