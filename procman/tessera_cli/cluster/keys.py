"""The keys that decide whose orders deputies obey: Ed25519, by PyNaCl.

The folder ~/.config/tessera (or TESSERA_KEYS) holds `sheriff.key`, this user's secret key, and `trusted_keys`, rows of
NAME PUBLIC-KEY whose orders a deputy of this user obeys, and whose deputies' words this user believes. Both are
created when first needed, and the user's own key is the first one trusted: on one machine nothing has to be set up.
"""

import base64
import binascii
import fcntl
import os
import re
from pathlib import Path

from nacl.signing import SigningKey

from tessera_cli.errors import UserError
from tessera_cli.files import changed_by_others, write_private

KEY_BYTES = 32
OWN_NAME = "me"
NAME = re.compile(r"[A-Za-z0-9_.@-]{1,64}")


def key_folder() -> Path:
    if folder := os.environ.get("TESSERA_KEYS"):
        return Path(folder)
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "tessera"


def to_text(key: bytes) -> str:
    return base64.b64encode(key).decode()


def from_text(text: str) -> bytes:
    """Raises ValueError if it is no key."""
    try:
        key = base64.b64decode(text, validate=True)
    except binascii.Error as error:
        raise ValueError("it is not base64") from error
    if len(key) != KEY_BYTES:
        raise ValueError(f"it has {len(key)} bytes instead of {KEY_BYTES}")
    return key


class KeyRing:
    """The keys in one folder. All methods raise UserError if a file is invalid or can't be written."""

    def __init__(self, folder: Path) -> None:
        self.secret_path = folder / "sheriff.key"
        self.trusted_path = folder / "trusted_keys"

    def signing_key(self) -> SigningKey:
        """Created by the first call."""
        self._make_first()
        if self.secret_path.stat().st_mode & 0o077:
            raise UserError(f"{self.secret_path} can be read by others; do: chmod 600 {self.secret_path}")
        return SigningKey(self._parse(self.secret_path.read_text().strip(), str(self.secret_path)))

    def own_public_key(self) -> str:
        return to_text(self.signing_key().verify_key.encode())

    def make(self) -> None:
        """A new key, trusted instead of the old one."""
        key = SigningKey.generate()
        try:
            self.secret_path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            write_private(self.secret_path, (to_text(key.encode()) + "\n").encode())
        except OSError as error:
            raise UserError(f"the key {self.secret_path} can't be written: {error.strerror}.") from error
        self._write({**self._read(), OWN_NAME: key.verify_key.encode()})

    def _make_first(self) -> None:
        """Once, also where several deputies of a user start at the same time."""
        if self.secret_path.exists():
            return
        try:
            self.secret_path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            folder = os.open(self.secret_path.parent, os.O_RDONLY)
        except OSError as error:
            raise UserError(f"the key {self.secret_path} can't be written: {error.strerror}.") from error
        try:
            fcntl.flock(folder, fcntl.LOCK_EX)
            if not self.secret_path.exists():
                self.make()
        finally:
            os.close(folder)

    def trusted(self) -> dict[str, bytes]:
        """Public keys by name; this user's own is among them unless it was revoked."""
        if not self.trusted_path.exists():
            self._make_first()
        return self._read()

    def trust(self, name: str, text: str) -> None:
        if not NAME.fullmatch(name):
            raise UserError(f"the name '{name}' must have letters, digits, _ . @ and - only.")
        self._write({**self.trusted(), name: self._parse(text, "the key given")})

    def revoke(self, name: str) -> None:
        keys = self.trusted()
        if keys.pop(name, None) is None:
            raise UserError(f"no key of the name '{name}' is trusted; known: {', '.join(keys) or 'none'}.")
        self._write(keys)

    def _read(self) -> dict[str, bytes]:
        if not self.trusted_path.exists():
            return {}
        for path in (self.trusted_path, self.trusted_path.parent):
            if changed_by_others(path):
                raise UserError(f"others can change {path}, so nobody is trusted; make it yours and: chmod go-w {path}")
        keys = {}
        for number, line in enumerate(self.trusted_path.read_text().splitlines(), start=1):
            words = line.partition("#")[0].split()
            if words and len(words) != 2:
                raise UserError(f"{self.trusted_path}:{number}: a row must be NAME KEY.")
            if words:
                keys[words[0]] = self._parse(words[1], f"{self.trusted_path}:{number}")
        return keys

    def _write(self, keys: dict[str, bytes]) -> None:
        try:
            self.trusted_path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            rows = "".join(f"{name} {to_text(key)}\n" for name, key in keys.items())
            write_private(self.trusted_path, rows.encode())
        except OSError as error:
            raise UserError(f"{self.trusted_path} can't be written: {error.strerror}.") from error

    @staticmethod
    def _parse(text: str, place: str) -> bytes:
        try:
            return from_text(text)
        except ValueError as error:
            raise UserError(f"{place}: this is no Ed25519 key: {error}.") from error
