"""The declarations of policies in files, read in separate processes that their code may damage.

`examine` loads the policies of an episode in one process and shares the options among them. A fork server keeps the
result, and the later episodes of a run need no such process. `PolicyDeclarations` reads
policies one by one. Each file has a process of its own, which then also checks options.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from types import TracebackType
from typing import NoReturn, Self

import msgspec
from msgspec.structs import replace

from lingjing.decoding import msgpack_decoder
from lingjing.errors import Fault, ForeignCodeError, InfrastructureError, LingjingError
from lingjing.mission.instance import GivenOption
from lingjing.option_listing import OptionSpec, option_specs
from lingjing.play.options import PlayOptions
from lingjing.play.policy_files import PolicyDeclaration, declaration_of, is_file, load_policy
from lingjing.play.policy_processes.agent_process import MemoryWatch, PolicyProcess
from lingjing.play.policy_processes.barrier import check_loaded, load_limit_s
from lingjing.play.policy_processes.messages import (
    CheckOptions,
    DeclarePolicy,
    ExaminePolicies,
    OptionsChecked,
    PoliciesExamined,
    PolicyAnswerMessage,
    PolicyDeclared,
    PolicyRequest,
    encoded,
    own_failure,
)
from lingjing.play.policy_processes.preloading import SERVES
from lingjing.play.policy_processes.servers import OpenServer, PolicyServer, WalledServer, walls_of
from lingjing.play.policy_processes.turns import Turn, wait_for
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import UNRECORDED, options_model
from lingjing.plugins.options import option_faults
from lingjing.plugins.policy import PolicyPlugin
from lingjing.processes.deadlines import OwnDeadline
from lingjing.processes.descendants import adopting
from lingjing.processes.fork_client import ForkServer, ForkServerClient
from lingjing.processes.kept_results import find_result
from lingjing.processes.walls.entering import Walls

_KEPT = msgpack_decoder(PoliciesExamined)


def examine(
    specs: Sequence[str], arguments: Mapping[str, GivenOption], server: PolicyServer, *, whole: bool
) -> PoliciesExamined:
    """Load the policies in a process of its own, share the options among them, and end it.

    The result without errors of an earlier episode is used again if the files are unchanged. `whole`: these are all
    policies that the options may belong to. Raises `ForeignCodeError` if the process ends or exceeds its time; other
    errors are in the result.
    """
    key = _examination_key(specs, arguments, server.walls, whole=whole)
    known = find_result(key) if key else None
    if known is not None:
        return _with_values(_KEPT.decode(known), arguments)
    examined = _examined(specs, arguments, server, whole=whole)
    if key and not examined.errors:
        with suppress(InfrastructureError):  # a server that has ended is reported by the next request
            server.keep_result(key, encoded(_without_values(examined)))
    return examined


def _examined(
    specs: Sequence[str], arguments: Mapping[str, GivenOption], server: PolicyServer, *, whole: bool
) -> PoliciesExamined:
    process = PolicyProcess("the mission", server, UNRECORDED)
    names = ", ".join(f"`{spec}`" for spec in specs)
    try:
        walled = server.walls is not None
        request = ExaminePolicies(specs=tuple(specs), arguments=dict(arguments), whole=whole, walled=walled)
        answer = _answer(process, request, f"polic{'y' if len(specs) == 1 else 'ies'} {names}")
        return answer if isinstance(answer, PoliciesExamined) else _raise_invalid(names)
    finally:
        process.end()


def _examination_key(
    specs: Sequence[str], arguments: Mapping[str, GivenOption], walls: Walls | None, *, whole: bool
) -> bytes:
    """Return the hash of a request and of the states of its files; b"" if a file cannot be found."""
    try:
        files = [_file_state(Path(spec.partition(":")[0])) for spec in specs if is_file(spec)]
        request = msgspec.msgpack.encode(("examination", specs, arguments, walls, whole, files))
    except (OSError, ValueError, OverflowError):  # the examination reports the fault
        return b""
    return hashlib.sha256(request).digest()


def _file_state(path: Path) -> tuple[str, int, int, int, int]:
    place = path.resolve(strict=True)
    state = place.stat()
    return str(place), state.st_dev, state.st_ino, state.st_size, state.st_mtime_ns


def _without_values(examined: PoliciesExamined) -> PoliciesExamined:
    """Return a result without the values of options, because the processes of all policies can read kept results."""
    policies = {
        spec: replace(policy, arguments=dict.fromkeys(policy.arguments)) for spec, policy in examined.found.items()
    }
    return replace(examined, found=policies)


def _with_values(examined: PoliciesExamined, arguments: Mapping[str, GivenOption]) -> PoliciesExamined:
    """Return a result of `_without_values` with the values of options."""
    policies = {
        spec: replace(policy, arguments={name: arguments[name] for name in policy.arguments})
        for spec, policy in examined.found.items()
    }
    return replace(examined, found=policies)


class PolicyDeclarations:
    """The declarations of policies by name or file. A context manager, which ends the processes of the files.

    Installed policies are read in this process. So are files on systems where policies run in the player's process (all
    but Linux). With `isolate`, policies that `host` does not offer are read in processes behind walls, as files are.
    """

    def __init__(self, host: PluginHost, *, isolate: bool = False) -> None:
        self._host = host
        self._isolate = isolate
        self._stack = ExitStack()
        self._client: ForkServerClient | None = None
        self._files: dict[str, _FileProcess] = {}

    def of(self, spec: str) -> PolicyDeclaration:
        """Return the declaration of a policy.

        Raises `UsageError` if there is no such policy, `ForeignCodeError` if its file cannot be loaded.
        """
        if self._is_apart(spec):
            return self._file(spec).declared()
        return declaration_of(self._plugin(spec))

    def listed_options(self, spec: str) -> tuple[OptionSpec, ...]:
        """Return the options of a policy for display. Raises as `of`."""
        if self._is_apart(spec):
            return self._file(spec).listed_options()
        return option_specs(options_model(self._plugin(spec)))

    def option_faults(self, spec: str, arguments: Mapping[str, GivenOption]) -> tuple[Fault, ...]:
        """Return every fault of the options. Raises as `of`."""
        if self._is_apart(spec):
            return self._file(spec).option_faults(arguments)
        return option_faults(options_model(self._plugin(spec)), arguments)

    def close(self) -> None:
        """End the processes."""
        self._stack.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _is_apart(self, spec: str) -> bool:
        is_foreign = is_file(spec) or (self._isolate and spec not in self._host.policies)
        return is_foreign and sys.platform == "linux"

    def _plugin(self, spec: str) -> PolicyPlugin:
        return load_policy(spec, self._host)

    def _file(self, spec: str) -> _FileProcess:
        if spec not in self._files:
            self._files[spec] = self._stack.enter_context(closing(_FileProcess(spec, self._server_for(spec))))
        return self._files[spec]

    def _server_for(self, spec: str) -> PolicyServer:
        if self._client is None:
            self._stack.enter_context(adopting())
            server = self._stack.enter_context(ForkServer(SERVES, walls=self._isolate))
            self._client = self._stack.enter_context(closing(server.client()))
        if self._isolate:
            return WalledServer(self._client, walls_of(PlayOptions(mission="", policy=spec)))
        return OpenServer(self._client)


class _FileProcess:
    """The process that has loaded one file.

    A file that fails to load is not loaded again. If a check of options ends the process, the next check starts
    another.
    """

    def __init__(self, spec: str, server: PolicyServer) -> None:
        self._spec = spec
        self._server = server
        self._process: PolicyProcess | None = None
        self._declared: PolicyDeclaration | None = None
        self._error: LingjingError | None = None

    def declared(self) -> PolicyDeclaration:
        """Return the declaration. Raises the error of the first attempt again."""
        if self._error is not None:
            raise self._error
        if self._process is None or not self._process.is_alive or self._declared is None:
            try:
                self._declared = self._load(listed=False).declaration
            except LingjingError as error:
                self._error = error
                raise
        return self._declared

    def listed_options(self) -> tuple[OptionSpec, ...]:
        """Return the options for display."""
        return self._load(listed=True).listed

    def option_faults(self, arguments: Mapping[str, GivenOption]) -> tuple[Fault, ...]:
        """Return every fault of the options."""
        self.declared()
        request = CheckOptions(spec=self._spec, arguments=dict(arguments))
        answer = self._ask(request, f"the check of the options of policy `{self._spec}`", "finished")
        return answer.faults if isinstance(answer, OptionsChecked) else _raise_invalid(f"`{self._spec}`")

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.end()

    def _load(self, *, listed: bool) -> PolicyDeclared:
        self.close()
        self._process = PolicyProcess(self._spec, self._server, UNRECORDED)
        walled = self._server.walls is not None
        answer = self._ask(
            DeclarePolicy(spec=self._spec, listed=listed, walled=walled), f"policy `{self._spec}`", "loaded"
        )
        return answer if isinstance(answer, PolicyDeclared) else _raise_invalid(f"`{self._spec}`")

    def _ask(self, request: PolicyRequest, what: str, done: str) -> PolicyAnswerMessage | None:
        if self._process is None:
            raise AssertionError("the process is not started")
        return _answer(self._process, request, what, done)


def _answer(
    process: PolicyProcess, request: PolicyRequest, what: str, done: str = "loaded"
) -> PolicyAnswerMessage | None:
    """Return the answer to a request. Raises the error that the answer brings, `ForeignCodeError` without an answer."""
    turn = Turn(process, [(request, ())], OwnDeadline(process.pid, load_limit_s(), watched=True))
    turn.send_next()
    watch = MemoryWatch([process])
    if process.is_walled:
        watch.begin()
    try:
        wait_for([turn])
    finally:
        watch.close()
    try:
        check_loaded(turn, what, done)
    except InfrastructureError as error:  # raised by the file's code, which cannot declare an outage
        raise own_failure(error) from error
    return turn.answer


def _raise_invalid(names: str) -> NoReturn:
    """Raise the error of a process that has sent an answer of another kind."""
    raise ForeignCodeError(f"{names} could not be loaded: the process did not send a declaration")


__all__ = ["PolicyDeclarations", "examine"]
