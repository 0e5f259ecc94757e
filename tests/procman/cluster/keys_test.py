"""Keys: made when first needed, trusted, revoked; each error is told."""

from pathlib import Path

import pytest

from helpers.orders import OTHER_KEY
from tessera_cli.cluster.keys import KeyRing, to_text
from tessera_cli.errors import UserError


def test_the_own_key_is_made_and_trusted_at_once(own_keys: Path) -> None:
    ring = KeyRing(own_keys)
    assert list(ring.trusted().values()) == [ring.signing_key().verify_key.encode()]
    assert ring.secret_path.stat().st_mode & 0o777 == 0o600
    assert KeyRing(own_keys).signing_key() == ring.signing_key()


def test_a_new_key_replaces_the_own_one_and_keeps_the_others(own_keys: Path) -> None:
    ring = KeyRing(own_keys)
    ring.trust("base", to_text(OTHER_KEY.verify_key.encode()))
    old = ring.signing_key()
    ring.make()
    assert ring.signing_key() != old
    assert set(ring.trusted().values()) == {ring.signing_key().verify_key.encode(), OTHER_KEY.verify_key.encode()}
    ring.revoke("base")
    assert list(ring.trusted()) == ["me"]


def test_faults_of_keys_are_named(own_keys: Path) -> None:
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
