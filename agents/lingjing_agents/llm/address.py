"""`Address`: a service's URL with its credentials kept separately."""

from __future__ import annotations

from dataclasses import dataclass, field
from urllib.parse import SplitResult, unquote, urlsplit, urlunsplit


@dataclass(frozen=True, slots=True)
class Address:
    """A URL without user and password."""

    url: str
    """The URL without credentials."""
    login: str = field(default="", repr=False)
    """The decoded `user:password`; "" without credentials."""

    @property
    def secrets(self) -> tuple[str, ...]:
        """The texts that must not be shown: the login and its password, or a user name without password, which is a
        token.
        """
        user, _, password = self.login.partition(":")
        return (self.login, password or user) if self.login else ()


def address(text: str) -> Address:
    """Parse the URL of a service.

    Raises `ValueError` if `text` is not an http(s) URL with a host and without query and fragment. The message quotes
    nothing of it.
    """
    split = _split(text)
    if split is None:
        raise ValueError("it is not a URL")
    parts, port = split
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise ValueError("it does not begin with http:// or https:// and a host")
    if parts.query or parts.fragment:
        raise ValueError("it has a query or a fragment")
    host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
    place = host if port is None else f"{host}:{port}"
    login = "" if parts.username is None else f"{unquote(parts.username)}:{unquote(parts.password or '')}"
    return Address(urlunsplit((parts.scheme, place, parts.path, "", "")), login)


def _split(text: str) -> tuple[SplitResult, int | None] | None:
    try:
        parts = urlsplit(text)
        return parts, parts.port
    except ValueError:  # its message quotes the text, so it must not become the cause of another error
        return None
