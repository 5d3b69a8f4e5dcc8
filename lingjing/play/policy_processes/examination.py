"""The declarations of policies in files, read by processes that may come to harm.

`examine` has one process load the policies of an episode and share the options among them. `PolicyDeclarations` reads
policies one by one, each file in a process of its own, which stays to check options.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from types import TracebackType
from typing import NoReturn, Self

from lingjing.errors import Fault, ForeignCodeError, InfrastructureError, LingjingError
from lingjing.mission.instance import GivenOption
from lingjing.option_listing import OptionSpec, option_specs
from lingjing.play.policy_files import PolicyDeclaration, declaration_of, is_file, load_policy
from lingjing.play.policy_processes.agent_process import PolicyProcess
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
    own_failure,
)
from lingjing.play.policy_processes.preloading import SERVES
from lingjing.play.policy_processes.turns import Turn, wait_for
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import UNRECORDED, options_model
from lingjing.plugins.options import option_faults
from lingjing.plugins.policy import PolicyPlugin
from lingjing.processes.deadlines import OwnDeadline
from lingjing.processes.descendants import adopting
from lingjing.processes.fork_client import ForkServer, ForkServerClient


def examine(
    specs: Sequence[str], arguments: Mapping[str, GivenOption], server: ForkServerClient, *, whole: bool
) -> PoliciesExamined:
    """Load the policies in a process of its own, share the options among them, and end it. `whole`: these are all that
    the options may be for.

    Raises `ForeignCodeError` if the process ends or is not done in time; other errors are in the result.
    """
    process = PolicyProcess("the mission", server, UNRECORDED)
    names = ", ".join(f"`{spec}`" for spec in specs)
    try:
        request = ExaminePolicies(specs=tuple(specs), arguments=dict(arguments), whole=whole)
        answer = _answer(process, request, f"polic{'y' if len(specs) == 1 else 'ies'} {names}")
        return answer if isinstance(answer, PoliciesExamined) else _refuse(names)
    finally:
        process.end()


class PolicyDeclarations:
    """The declarations of policies by name or file. A context manager, which ends the processes of the files.

    Installed policies are read in this process, and so are files where policies play in the player's process (elsewhere
    than on Linux).
    """

    def __init__(self, host: PluginHost) -> None:
        self._host = host
        self._stack = ExitStack()
        self._server: ForkServerClient | None = None
        self._files: dict[str, _FileProcess] = {}

    def of(self, spec: str) -> PolicyDeclaration:
        """The declaration of a policy. Raises `UsageError` if there is no such policy, `ForeignCodeError` if its file
        cannot be loaded."""
        if self._is_apart(spec):
            return self._file(spec).declared()
        return declaration_of(self._plugin(spec))

    def listed_options(self, spec: str) -> tuple[OptionSpec, ...]:
        """The options of a policy as people read them. Raises as `of`."""
        if self._is_apart(spec):
            return self._file(spec).listed_options()
        return option_specs(options_model(self._plugin(spec)))

    def option_faults(self, spec: str, arguments: Mapping[str, GivenOption]) -> tuple[Fault, ...]:
        """Everything that is wrong with the options. Raises as `of`."""
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
        return is_file(spec) and sys.platform == "linux"

    def _plugin(self, spec: str) -> PolicyPlugin:
        return load_policy(spec, self._host)

    def _file(self, spec: str) -> _FileProcess:
        if spec not in self._files:
            if self._server is None:
                self._stack.enter_context(adopting())
                self._server = self._stack.enter_context(
                    closing(self._stack.enter_context(ForkServer(SERVES)).client())
                )
            self._files[spec] = self._stack.enter_context(closing(_FileProcess(spec, self._server)))
        return self._files[spec]


class _FileProcess:
    """The process that has loaded one file. A file that cannot be loaded is not tried again; a check of options that
    ends the process is followed by a new one."""

    def __init__(self, spec: str, server: ForkServerClient) -> None:
        self._spec = spec
        self._server = server
        self._process: PolicyProcess | None = None
        self._declared: PolicyDeclaration | None = None
        self._error: LingjingError | None = None

    def declared(self) -> PolicyDeclaration:
        """The declaration."""
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
        """The options as people read them."""
        return self._load(listed=True).listed

    def option_faults(self, arguments: Mapping[str, GivenOption]) -> tuple[Fault, ...]:
        """Everything that is wrong with the options."""
        self.declared()
        request = CheckOptions(spec=self._spec, arguments=dict(arguments))
        answer = self._ask(request, f"the check of the options of policy `{self._spec}`", "finished")
        return answer.faults if isinstance(answer, OptionsChecked) else _refuse(f"`{self._spec}`")

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.end()

    def _load(self, *, listed: bool) -> PolicyDeclared:
        self.close()
        self._process = PolicyProcess(self._spec, self._server, UNRECORDED)
        answer = self._ask(DeclarePolicy(spec=self._spec, listed=listed), f"policy `{self._spec}`", "loaded")
        return answer if isinstance(answer, PolicyDeclared) else _refuse(f"`{self._spec}`")

    def _ask(self, request: PolicyRequest, what: str, done: str) -> PolicyAnswerMessage | None:
        if self._process is None:
            raise AssertionError("nothing is asked of a process before it is started")
        return _answer(self._process, request, what, done)


def _answer(
    process: PolicyProcess, request: PolicyRequest, what: str, done: str = "loaded"
) -> PolicyAnswerMessage | None:
    """The answer to a request. Raises the error that it brings, and `UsageError` if none comes."""
    turn = Turn(process, [(request, ())], OwnDeadline(process.pid, load_limit_s(), watched=True))
    turn.send_next()
    wait_for([turn])
    try:
        check_loaded(turn, what, done)
    except InfrastructureError as error:  # nothing but the code in the file could say so
        raise own_failure(error) from error
    return turn.answer


def _refuse(names: str) -> NoReturn:
    raise ForeignCodeError(f"{names} could not be loaded: nonsense came instead of a declaration")


__all__ = ["PolicyDeclarations", "examine"]
