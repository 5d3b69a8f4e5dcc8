"""The requests to a fork server, as both ends know them.

A request comes with descriptors. The last one is the *listener*: the channel that receives the process id and the end
of what is started (`fork_client.ForkedProcess`).
"""

from __future__ import annotations

from collections.abc import Callable

import msgspec

Function = Callable[[bytes, tuple[int, ...]], None]
"""A function that a fork calls: with the argument of its request, and with descriptors that it owns."""


class Surroundings(msgspec.Struct, frozen=True):
    """The working folder and the variables of a process, as bytes: neither need be UTF-8."""

    folder: bytes
    environment: dict[bytes, bytes]


class RunModule(msgspec.Struct, frozen=True, tag=True):
    """Run a module as `python -m` would. Descriptors: standard input, output and error, listener."""

    module: str
    arguments: tuple[str, ...]
    surroundings: Surroundings


class CallFunction(msgspec.Struct, frozen=True, tag=True):
    """Call a function in the server itself, for what later forks shall share. No descriptors, not even a listener."""

    function: str
    """As `module:name`."""
    argument: str
    in_layers: bool = False
    """Call it in the server's layers as well (`layers`)."""


class Template(msgspec.Struct, frozen=True):
    """A fork that makes something ready, and of which the processes are forked that need it.

    `source` (`module:name`) is called in the server with the request's argument and `key`. It returns None if there is
    no such template, else a function that is called in the template's process, makes the thing ready, and returns the
    `Function` that each of its forks calls.
    """

    source: str
    key: bytes


class StartFunction(msgspec.Struct, frozen=True, tag=True):
    """Start a process that calls a `Function`. It ends with the process that asks.

    Descriptors: those that the function gets, what the process writes its output to, a pidfd of the process that asks,
    listener.
    """

    function: str
    """As `module:name`."""
    argument: bytes = b""
    surroundings: Surroundings | None = None
    """The surroundings of the server if absent."""
    reuse: bool = False
    """Take a process that has served such a request before and is idle, if there is one (`idle_processes`)."""
    template: Template | None = None
    """Fork it of this template, if there is one or it can be made."""
    layer: str = ""
    """Fork it of the server's layer of that name, if the server has one (`layers`)."""


ForkRequest = RunModule | StartFunction | CallFunction

__all__ = ["CallFunction", "ForkRequest", "Function", "RunModule", "StartFunction", "Surroundings", "Template"]
