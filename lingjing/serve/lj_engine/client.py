"""The connection of our engines to a backend: dial in, greet, answer commands until it closes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Any
from urllib.parse import urlsplit

import msgspec
import numpy as np

from lingjing.decoding import from_json
from lingjing.errors import InfrastructureError, UsageError
from lingjing.installation import install_line
from lingjing.plugins.host import PluginHost
from lingjing.serve.lj_engine.answers import Answers, EngineSettings
from lingjing.serve.lj_engine.hosted_engines import HostedEngines
from lingjing.serve.lj_engine.server import MOST_FRAME
from lingjing.serve.lj_engine.sessions import key_of

_CONNECT_S = 10.0
"""Time for the handshake and the first frame, seconds (chosen)."""
_IDLE_S = 0.2
"""Longest wait for a command before telemetry is looked at, wall-clock seconds (chosen)."""


def checked_url(url: str) -> tuple[str, str]:
    """Return (host, address of the session) of a backend's URL. Raises `UsageError`."""
    try:
        parts = urlsplit(url)
        key = key_of(parts.path)
    except ValueError:
        parts, key = urlsplit(""), None
    if parts.scheme not in ("ws", "wss") or not parts.hostname or key is None:
        raise UsageError(f"{url} is no address of a session", hint="such as ws://127.0.0.1:9909/ws/LJ-ENGINE/airsim")
    return parts.hostname, key[1]


def serve_backend(
    url: str, settings: EngineSettings, names: tuple[str, ...], token: str, *, once: bool, say: Callable[[str], None]
) -> None:
    """Play our engines for the backend at `url` until it closes the connection, or with `once` until an episode ends.

    Raises `UsageError` if `websockets` is missing, `InfrastructureError` if there is no backend or it goes away in the
    middle of an episode.
    """
    with ExitStack() as stack:
        host = PluginHost()
        _prepare(host, names)
        connection = _connected(url, token, stack)

        def send(message: object) -> None:
            connection.send(msgspec.json.encode(message, enc_hook=_plain).decode())

        answers = Answers(settings, host, HostedEngines(host, names), send, say)
        stack.callback(answers.close)
        _answer_all(connection, answers, once=once)


def _prepare(host: PluginHost, names: tuple[str, ...]) -> None:
    """Import the engines before the session begins: a backend waits 5 s for the acknowledgement of a scenario."""
    from lingjing.dsl.loading import load  # noqa: F401 - imported for its modules

    for name in names:
        with suppress(InfrastructureError):  # a package is missing; a scenario with bodies of its engine reports this
            host.engine(name).factory().close()


def _answer_all(connection: Any, answers: Answers, *, once: bool) -> None:
    from websockets.exceptions import ConnectionClosed

    try:
        while not (once and answers.ended):
            try:
                text = connection.recv(timeout=0.0 if answers.busy else _IDLE_S)
            except TimeoutError:
                answers.idle()
            else:
                answers.take(text)
            answers.advance()
    except ConnectionClosed as error:
        if answers.playing:
            raise InfrastructureError(f"the backend has closed the connection: {str(error)[:200]}") from error


def _connected(url: str, token: str, stack: ExitStack) -> Any:
    """Return a connection that the backend has greeted. `stack` closes it."""
    try:
        from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidStatus, InvalidURI
        from websockets.sync.client import connect
    except ImportError as error:
        raise UsageError(
            "LJ-ENGINE needs websockets, which is not installed", hint=install_line("lj-engine")
        ) from error
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    try:
        opening = connect(
            url, additional_headers=headers, open_timeout=_CONNECT_S, max_size=MOST_FRAME, compression=None,
            ping_interval=20.0, ping_timeout=60.0, proxy=None,
        )  # fmt: skip
        connection = stack.enter_context(opening)
    except InvalidStatus as error:
        reason = (error.response.body or b"").decode("utf-8", "replace").strip()[:200]
        message = f"the backend at {url} refuses the session: {error.response.status_code} {reason}"
        raise InfrastructureError(message) from error
    except (OSError, InvalidHandshake, InvalidURI) as error:
        hint = "start it first: `lingjing serve --lj-engine MISSION`, or the paper's system"
        raise InfrastructureError(f"no backend answers at {url}: {error}", hint=hint) from error
    try:
        greeting = connection.recv(timeout=_CONNECT_S)
        content = from_json(greeting)
    except (TimeoutError, ConnectionClosed, msgspec.DecodeError) as error:
        raise InfrastructureError(f"the backend at {url} does not greet: {error}") from error
    data = content.get("data") if isinstance(content, dict) else None
    if not isinstance(data, dict) or data.get("code") not in (0, None):
        raise InfrastructureError(f"the backend at {url} refuses the session: {str(data)[:200]}")
    return connection


def _plain(value: object) -> object:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise NotImplementedError(f"a value of type {type(value).__name__} cannot be sent")
