"""The declarations of policies in files, read by a process that may come to harm: `examine`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lingjing.errors import UsageError
from lingjing.kernel.world.deadlines import OwnDeadline
from lingjing.kernel.world.forking import ForkServerClient
from lingjing.mission.instance import GivenOption
from lingjing.play.policy_processes.agent_process import PolicyProcess
from lingjing.play.policy_processes.barrier import LOAD_S, check_loaded
from lingjing.play.policy_processes.messages import ExaminePolicies, PoliciesExamined
from lingjing.play.policy_processes.turns import Turn, wait_for
from lingjing.plugins.loading import UNRECORDED


def examine(
    specs: Sequence[str], arguments: Mapping[str, GivenOption], server: ForkServerClient, *, whole: bool
) -> PoliciesExamined:
    """Load the policies in a process of its own, share the options among them, and end it. `whole`: these are all that
    the options may be for.

    Raises `UsageError` if the process ends or is not done in time; other errors are in what is returned.
    """
    process = PolicyProcess("the mission", server, UNRECORDED)
    try:
        request = ExaminePolicies(specs=tuple(specs), arguments=dict(arguments), whole=whole)
        turn = Turn(process, [(request, ())], OwnDeadline(process.pid, LOAD_S, watched=True))
        turn.send_next()
        wait_for([turn])
        names = ", ".join(f"`{spec}`" for spec in specs)
        check_loaded(turn, f"polic{'y' if len(specs) == 1 else 'ies'} {names}")
        if isinstance(turn.answer, PoliciesExamined):
            return turn.answer
        raise UsageError(f"{names} could not be loaded: nonsense came instead of their declarations")
    finally:
        process.end()
