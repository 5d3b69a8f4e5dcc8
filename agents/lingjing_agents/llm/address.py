"""`Address`: a service's URL, with the credentials in it told apart from what may be shown."""

from __future__ import annotations

from dataclasses import dataclass, field
from urllib.parse import SplitResult, unquote, urlsplit, urlunsplit


@dataclass(frozen=True, slots=True)
class Address:
    """`url` without user and password; `login` is `user:password`, decoded, or empty."""

    url: str
    login: str = field(default="", repr=False)

    @property
    def secrets(self) -> tuple[str, ...]:
        """What of the address must not be told: the login and its password; a user name alone (a token) if there is
        no password."""
        user, _, password = self.login.partition(":")
        return (self.login, password or user) if self.login else ()


def address(text: str) -> Address:
    """`text` taken apart. Raises `ValueError`, which quotes nothing, if it is not an http(s) URL with a host and
    without query and fragment."""
    taken = _taken_apart(text)
    if taken is None:
        raise ValueError("it is not a URL")
    parts, port = taken
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise ValueError("it does not begin with http:// or https:// and a host")
    if parts.query or parts.fragment:
        raise ValueError("it has a query or a fragment")
    host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
    place = host if port is None else f"{host}:{port}"
    login = "" if parts.username is None else f"{unquote(parts.username)}:{unquote(parts.password or '')}"
    return Address(urlunsplit((parts.scheme, place, parts.path, "", "")), login)


def _taken_apart(text: str) -> tuple[SplitResult, int | None] | None:
    try:
        parts = urlsplit(text)
        return parts, parts.port
    except ValueError:  # it quotes the text: nothing may hang on to it
        return None
