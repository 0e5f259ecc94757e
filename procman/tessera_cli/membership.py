"""What makes a process a member of a run: the run's secret, and the tags that messages carry because of it.

A run's folder on a node (the setting bus.run_dir) can be read by its owner only, and holds the file `secret`. The tags
are those of modules/streams/authenticator.h, here made by libsodium.
"""

import fcntl
import hashlib
import hmac
import os
import secrets
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

from nacl.bindings import crypto_aead_chacha20poly1305_ietf_encrypt

from tessera_cli.errors import UserError
from tessera_cli.files import replacing

SECRET_BYTES, NONCE_BYTES, TAG_BYTES = 32, 12, 16
# The tag stands behind the fingerprint of the message's type; the rest of the header is within so many bytes behind it.
TAG_OFFSET, HEADER_BYTES = 8, 128

# What an order says for bus.run_dir: each deputy puts a folder of its own in its place.
LOCAL_RUN_DIR = "local"
# Where this user has no secret of a run.
MEMBERS_ONLY = (
    "the stack on this bus answers its own members only: give this command where it was started, as its user "
    "(--port and --prefix as there)."
)


def draw_secret() -> bytes:
    return secrets.token_bytes(SECRET_BYTES)


def sign_message(channel: str, data: bytes, secret: bytes) -> bytes:
    """The encoded message with its tag. `channel`: with prefix."""
    return data[:TAG_OFFSET] + _tag(channel, data, secret) + data[TAG_OFFSET + TAG_BYTES :]


def is_of_member(channel: str, data: bytes, secret: bytes) -> bool:
    """Whether who sent these bytes knows the secret."""
    tag = data[TAG_OFFSET : TAG_OFFSET + TAG_BYTES]
    return len(tag) == TAG_BYTES and hmac.compare_digest(tag, _tag(channel, data, secret))


def _tag(channel: str, data: bytes, secret: bytes) -> bytes:
    content = data[TAG_OFFSET + TAG_BYTES :]
    head = channel.encode() + b"\0" + data[:TAG_OFFSET] + content[:HEADER_BYTES]
    nonce = hashlib.sha256(head).digest()[:NONCE_BYTES]
    return crypto_aead_chacha20poly1305_ietf_encrypt(b"", content, nonce, secret)


class RunDir:
    """The folder of a run on this machine. All methods raise UserError if the file system refuses."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._secret_path = path / "secret"
        self._lock: int | None = None

    def make(self, secret: bytes) -> None:
        """Also where another secret is there already: what has that one is no member any longer."""
        try:
            self.path.mkdir(parents=True, exist_ok=True, mode=0o700)
            self.path.chmod(0o700)
            with replacing(self._secret_path) as written:
                written.unlink(missing_ok=True)
                descriptor = os.open(written, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
                with os.fdopen(descriptor, "w") as file:
                    file.write(secret.hex() + "\n")
        except OSError as error:
            raise UserError(
                f"the run's folder {self.path} can't be written: {error.strerror}; TESSERA_KEYS may name another place."
            ) from error

    def lock(self, sentence_if_used: str) -> None:
        """Until this process ends. Raises UserError with this sentence if another one has it."""
        try:
            self.path.mkdir(parents=True, exist_ok=True, mode=0o700)
            self._lock = os.open(self.path, os.O_RDONLY)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise UserError(sentence_if_used) from error
        except OSError as error:
            raise UserError(
                f"the run's folder {self.path} can't be used: {error.strerror}; TESSERA_KEYS may name another place."
            ) from error

    def is_locked(self) -> bool:
        """Whether another process has it, also one in another network namespace."""
        try:
            descriptor = os.open(self.path, os.O_RDONLY)
        except OSError:
            return False  # nobody made it yet; one that can't be used is told of by lock
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        finally:
            os.close(descriptor)
        return False

    def unlock(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    @property
    def journals(self) -> Path:
        """Where stages of a list keep what a successor needs (modules/runtime/journal.h)."""
        return self.path / "journal"

    def forget_journals(self) -> None:
        """Those of another run are of no use."""
        shutil.rmtree(self.journals, ignore_errors=True)

    def secret(self) -> bytes | None:
        """None if there is none."""
        try:
            text = self._secret_path.read_text().strip()
        except FileNotFoundError:
            return None
        except (OSError, UnicodeDecodeError) as error:
            raise UserError(f"{self._secret_path} can't be read: {error}.") from error
        try:
            secret = bytes.fromhex(text)
        except ValueError:
            secret = b""
        if len(secret) != SECRET_BYTES:
            raise UserError(f"{self._secret_path} holds no secret of a run; remove it, and start the run again.")
        return secret

    def end(self) -> None:
        """The run is over: its secret is of no use any longer."""
        self._secret_path.unlink(missing_ok=True)


def run_dir_of(folder: Path, main_url: str, channel_prefix: str) -> RunDir:
    """Of the stack that this user has on this bus with these channels. `folder`: of the user's keys."""
    bus = main_url.partition("?")[0].removeprefix("udpm://")
    return RunDir(folder / "runs" / quote(f"{bus} {channel_prefix}".strip(), safe=" "))


def secret_of(settings: Mapping[str, Any]) -> bytes | None:
    """Of the run with these settings, as far as this machine knows it; None: its messages are not checked."""
    run_dir = settings["bus"]["run_dir"]
    return RunDir(Path(run_dir)).secret() if run_dir else None


def pool_secret(folder: Path) -> bytes:
    """Of all stacks of this user that share extractors; drawn when it is first needed. `folder`: of the user's keys."""
    pool = RunDir(folder / "runs" / "pool")
    secret = pool.secret()
    if secret is None:
        secret = draw_secret()
        pool.make(secret)
    return secret
