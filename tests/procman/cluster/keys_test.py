"""Keys: made when first needed, trusted, revoked; each error is told."""

import os
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


def test_keys_that_others_can_change_are_not_trusted(own_keys: Path) -> None:
    ring = KeyRing(own_keys)
    assert list(ring.trusted()) == ["me"]
    assert ring.trusted_path.stat().st_mode & 0o777 == 0o600
    for path, mode in ((ring.trusted_path, 0o620), (ring.trusted_path, 0o602), (own_keys, 0o777)):
        before = path.stat().st_mode
        path.chmod(mode)
        with pytest.raises(UserError, match=f"others can change {path}, .*chmod go-w {path}"):
            ring.trusted()
        path.chmod(before)
    assert list(ring.trusted()) == ["me"]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_keys_that_belong_to_others_are_not_trusted(own_keys: Path) -> None:
    ring = KeyRing(own_keys)
    ring.trusted()
    os.chown(ring.trusted_path, 65534, -1)
    with pytest.raises(UserError, match="others can change"):
        ring.trusted()
