"""The requests to a fork server.

A request comes with descriptors. The last one is the *listener*: the channel that receives the process id and the wait
status of the started process (`fork_client.ForkedProcess`).
"""

from __future__ import annotations

from collections.abc import Callable

import msgspec

Function = Callable[[bytes, tuple[int, ...]], None]
"""A function that a fork calls, with the argument of its request and with descriptors that it owns."""


class Surroundings(msgspec.Struct, frozen=True):
    """The working folder and the environment of a process, as bytes, because both may be invalid UTF-8."""

    folder: bytes
    environment: dict[bytes, bytes]


class RunModule(msgspec.Struct, frozen=True, tag=True):
    """Run a module as `python -m` does. Descriptors: standard input, output and error, `further`, listener."""

    module: str
    arguments: tuple[str, ...]
    surroundings: Surroundings
    further: tuple[str, ...] = ()
    """The options of the module that name its further descriptors."""


class CallFunction(msgspec.Struct, frozen=True, tag=True):
    """Call a function in the server itself, to prepare data that later forks share. It has no descriptors."""

    function: str
    """The function, as `module:name`."""
    argument: str
    in_layers: bool = False
    """True to call it in the server's layers too (`layers`)."""


class KeepResult(msgspec.Struct, frozen=True, tag=True):
    """Keep a result for later forks (`kept_results`). It has no descriptors."""

    key: bytes
    result: bytes


class Template(msgspec.Struct, frozen=True):
    """A fork that has prepared an object, and from which the processes that need the object are forked.

    `source` (`module:name`) is called in the server with the request's argument and `key`. It returns None if there is
    no such template. Otherwise it returns a function that is called in the template's process: that function prepares
    the object, and returns the `Function` that each fork of the template calls.
    """

    source: str
    key: bytes


class StartFunction(msgspec.Struct, frozen=True, tag=True):
    """Start a process that calls a `Function`. It ends with the requesting process.

    Descriptors: those of the function, the output of the process, a pidfd of the requesting process, listener.
    """

    function: str
    """The function, as `module:name`."""
    argument: bytes = b""
    """The argument of the function."""
    surroundings: Surroundings | None = None
    """The surroundings of the process; None for those of the server."""
    reuse: bool = False
    """True to use an idle process that has served an equal request, if there is one (`idle_processes`)."""
    template: Template | None = None
    """The template to fork from, if it exists or can be made; None for a fork of the server."""
    layer: str = ""
    """The name of the layer to fork from, if the server has it (`layers`); "" for the server itself."""


ForkRequest = RunModule | StartFunction | CallFunction | KeepResult

__all__ = [
    "CallFunction", "ForkRequest", "Function", "KeepResult", "RunModule", "StartFunction", "Surroundings", "Template",
]  # fmt: skip
