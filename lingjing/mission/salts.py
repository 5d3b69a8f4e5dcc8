"""Sealed splits: instances that cannot be drawn without a secret file, the *salt*.

With a salt, the seed of an instance is drawn from the salt and the public seed. The hash of the file stands in each
trace and row, so it can be published before anything is played; the file itself is published later. Everyone can then
draw the instances again, and check that they are those of the hash.
"""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Mapping
from pathlib import Path

import msgspec

from lingjing.errors import UsageError
from lingjing.mission.seeding import integer

SALT_BYTES = 16
"""The shortest salt, bytes. Chosen: 128 random bits cannot be guessed."""
SALT_MOST = 4096
"""The longest salt, bytes. Chosen: a longer file is probably none."""

SALT_KEY, SEED_KEY = "salt", "salt.seed"
"""The entries of a trace's fingerprint: the hash of the salt, and the public seed."""

_MAKE = "make one: `umask 077; openssl rand -hex 32 > split.salt`"


class Salt(msgspec.Struct, frozen=True):
    """The content of a salt file."""

    text: bytes
    """The secret, without white space at its ends."""
    sha256: str
    """The SHA-256 of the file, as `sha256sum` prints it."""

    def seed(self, public: int) -> int:
        """Return the seed of the instance for a public seed, 0 to 2⁶³ - 1. It is the same for every mission."""
        return integer(0, f"sealed split/{self.text.hex()}/{public}") % 2**63


def read_salt(path: str | Path, *, published: bool = False) -> Salt:
    """Return the salt of a file. Raises `UsageError` if it cannot be read, is no salt, or is not secret.

    `published`: the file may be readable for other users.
    """
    try:
        with Path(path).open("rb") as file:
            content, mode = file.read(SALT_MOST + 1), os.fstat(file.fileno()).st_mode
    except FileNotFoundError as error:
        raise UsageError(f"there is no salt file `{path}`", hint=_MAKE) from error
    except OSError as error:
        raise UsageError(f"cannot read the salt file `{path}`: {error.strerror}") from error
    text = content.strip()
    if len(text) < SALT_BYTES or len(content) > SALT_MOST:
        raise UsageError(
            f"`{path}` is no salt: it has {len(text)} bytes, and {SALT_BYTES} to {SALT_MOST} are required", hint=_MAKE
        )
    if not published and stat.S_IMODE(mode) & 0o077:
        raise UsageError(
            f"the salt file `{path}` is not secret: its mode is {stat.S_IMODE(mode):03o}", hint=f"chmod 600 {path}"
        )
    return Salt(text, hashlib.sha256(content).hexdigest())


def instance_seed(salt: str, public: int) -> int:
    """Return the seed of an instance. `salt`: the file of the salt; "" for the public seed itself."""
    return read_salt(salt).seed(public) if salt else public


def salt_fingerprint(salt: str, public: int) -> dict[str, str]:
    """Return the entries of a trace's fingerprint; none without a salt file."""
    return {SALT_KEY: read_salt(salt).sha256, SEED_KEY: str(public)} if salt else {}


def public_seed(fingerprint: Mapping[str, str], seed: int) -> int:
    """Return the public seed of a trace. `fingerprint`: that of its header. `seed`: the seed of its instance."""
    text = fingerprint.get(SEED_KEY, "")
    return int(text) if text.isascii() and text.isdigit() else seed


def salt_fault(salt: Salt, fingerprint: Mapping[str, str], seed: int) -> str:
    """Return the reason for which an instance with this seed is not of the salt's split; "" if it is."""
    drawn_with = fingerprint.get(SALT_KEY, "")
    if not drawn_with:
        return "its instance was drawn from a public seed, without a salt"
    if drawn_with != salt.sha256:
        return f"it names another salt: SHA-256 {drawn_with[:16]}…, and the file has {salt.sha256[:16]}…"
    public = public_seed(fingerprint, -1)
    if public < 0 or salt.seed(public) != seed:
        return f"its instance is not the one that the salt draws for seed {public}"
    return ""


__all__ = [
    "SALT_KEY",
    "SEED_KEY",
    "Salt",
    "instance_seed",
    "public_seed",
    "read_salt",
    "salt_fault",
    "salt_fingerprint",
]
