"""Members of a run know each other by its secret, which only the run's owner can read."""

from pathlib import Path

import pytest

from tessera_cli.errors import UserError
from tessera_cli.membership import RunDir, draw_secret, is_of_member, pool_secret, run_dir_of, sign_message

SECRET = bytes(range(32))
MESSAGE = bytes(number % 256 for number in range(300))


def test_tags_are_those_of_the_stages() -> None:
    """The same numbers stand in tests/streams/authenticator_test.cc, whose tags are made by OpenSSL."""
    assert sign_message("POSE", MESSAGE, SECRET)[8:24].hex() == "ba35314392b631b687cd82433601b3fb"


def test_only_what_a_member_sent_on_this_channel_is_a_members() -> None:
    signed = sign_message("POSE", MESSAGE, SECRET)
    assert is_of_member("POSE", signed, SECRET)
    assert not is_of_member("STATUS", signed, SECRET)
    assert not is_of_member("POSE", MESSAGE, SECRET)
    assert not is_of_member("POSE", signed, draw_secret())
    for position in range(len(signed)):
        changed = bytearray(signed)
        changed[position] ^= 1 << position % 8
        assert not is_of_member("POSE", bytes(changed), SECRET)
        assert not is_of_member("POSE", signed[:position], SECRET)


def test_a_secret_is_for_its_owners_eyes(tmp_path: Path) -> None:
    run_dir = run_dir_of(tmp_path, "udpm://239.255.76.67:7667?ttl=0", "a/")
    assert run_dir.secret() is None
    run_dir.make(SECRET)
    assert run_dir.secret() == SECRET
    assert run_dir.path.stat().st_mode & 0o777 == 0o700
    assert (run_dir.path / "secret").stat().st_mode & 0o777 == 0o600
    assert run_dir_of(tmp_path, "udpm://239.255.76.67:7667?ttl=1", "a/").secret() == SECRET
    assert run_dir_of(tmp_path, "udpm://239.255.76.67:7667?ttl=0", "a_").secret() is None
    run_dir.end()
    assert run_dir.secret() is None


def test_a_damaged_secret_is_told(tmp_path: Path) -> None:
    run_dir = RunDir(tmp_path / "run")
    run_dir.make(SECRET)
    (run_dir.path / "secret").write_text("secret\n")
    with pytest.raises(UserError, match="holds no secret"):
        run_dir.secret()


def test_one_run_at_a_time_has_a_folder(tmp_path: Path) -> None:
    first, second = RunDir(tmp_path / "run"), RunDir(tmp_path / "run")
    first.lock("it is taken.")
    with pytest.raises(UserError, match="it is taken"):
        second.lock("it is taken.")
    first.unlock()
    second.lock("it is taken.")


def test_stacks_that_share_extractors_have_one_secret(tmp_path: Path) -> None:
    assert pool_secret(tmp_path) == pool_secret(tmp_path)
    assert pool_secret(tmp_path) != pool_secret(tmp_path / "of another user")
