"""The checks of a policy: its brief allows its commands and messages, and the same inputs give the same decisions."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import msgspec

from lingjing.plugins.conformance.case import require, run_all
from lingjing.plugins.foreign_errors import kind_of_value
from lingjing.plugins.hook_faults import check_declaration
from lingjing.plugins.loading import build_policy
from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, PolicyPlugin


@dataclass(frozen=True, slots=True)
class PolicyCase:
    """The inputs of the checks of a policy."""

    plugin: PolicyPlugin
    brief: Brief
    observations: tuple[Observation, ...]
    deterministic: bool = True
    """True if the policy promises equal decisions for equal inputs. A chat model does not."""
    arguments: tuple[tuple[str, str], ...] = ()
    """The options of the policy."""


def check_policy(
    plugin: PolicyPlugin,
    brief: Brief,
    observations: Sequence[Observation] = (),
    *,
    deterministic: bool = True,
    arguments: dict[str, str] | None = None,
) -> None:
    """Run every check of a policy. Without observations it receives three empty ones."""
    check_declaration(plugin, "lingjing_policies", plugin.name)
    shown = tuple(observations) or tuple(
        Observation(agent=brief.agent, tick=tick, time_s=tick * brief.tick_s, weather=brief.weather)
        for tick in range(3)
    )
    pairs = tuple(sorted((arguments or {}).items()))
    run_all(f"policy `{plugin.name}`", POLICY_CHECKS, PolicyCase(plugin, brief, shown, deterministic, pairs))


def check_decisions(case: PolicyCase) -> None:
    """Check that `act` returns a `Decision` with a command and messages that the brief allows."""
    for decision in _decide(case):
        require(isinstance(decision, Decision), f"act: {kind_of_value(decision)} instead of a Decision")
        _command(case.brief, decision)
        kinds = {message.kind: message for message in case.brief.messages}
        for message in decision.messages:
            require(message.kind in kinds, f"act: a message `{message.kind}`, allowed are {', '.join(kinds) or 'none'}")
            needed = {part.name for part in kinds[message.kind].fields if not part.optional}
            missing = sorted(needed - set(message.body))
            require(not missing, f"act: a `{message.kind}` without {', '.join(missing)}")
            for name, value in message.body.items():
                parts = value if isinstance(value, tuple) else (value,)
                finite = all(math.isfinite(part) for part in parts if isinstance(part, float))
                require(finite, f"act: a `{message.kind}`: `{name}` is {value!r}, finite numbers are due")
            require(set(message.to) <= {peer.id for peer in case.brief.peers}, "act: a message to an unknown agent")


def check_same_decisions(case: PolicyCase) -> None:
    """Check that two objects with the same brief and observations decide the same."""
    if case.deterministic:
        first, second = (list(map(msgspec.msgpack.encode, _decide(case))) for _ in range(2))  # NaN equals itself there
        require(first == second, "two policies with the same brief and observations decide differently")


POLICY_CHECKS: tuple[Callable[[PolicyCase], None], ...] = (check_decisions, check_same_decisions)
"""Every check of a policy."""


def _command(brief: Brief, decision: Decision) -> None:
    command = decision.command
    if command is None:
        return
    resources = {resource.id: resource for resource in brief.resources}
    name = command.resource or next((resource.id for resource in brief.resources if resource.embodied), "")
    require(name in resources, f"act: a command to `{name}`, which the agent may not command")
    verbs = {verb.name: verb for verb in resources[name].verbs}
    require(command.verb in verbs, f"act: `{name}` has no verb `{command.verb}`; it has {', '.join(verbs)}")
    declared = {argument.name: argument for argument in verbs[command.verb].arguments}
    strange = sorted(set(command.arguments) - set(declared))
    known = ", ".join(declared) or "nothing"
    require(not strange, f"act: `{command.verb}` takes no {', '.join(strange)}; it takes {known}")
    needed = [name for name, spec in declared.items() if spec.default is None and not spec.optional]
    missing = [name for name in needed if name not in command.arguments]
    require(not missing, f"act: `{command.verb}` without {', '.join(missing)}")
    numbers = {name: value for name, value in command.arguments.items() if declared[name].unit != "name"}
    for name, value in numbers.items():
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        finite = is_number and math.isfinite(float(value))  # type: ignore[arg-type]
        require(finite, f"act: `{command.verb}`: `{name}` is {value!r}, a finite number is due")


def _decide(case: PolicyCase) -> list[Decision]:
    async def play() -> list[Decision]:
        policy = build_policy(case.plugin, dict(case.arguments))
        await policy.reset(case.brief)
        return [await policy.act(observation, Inbox()) for observation in case.observations]

    with ThreadPoolExecutor(max_workers=1) as worker:  # as in an episode: a thread and a loop of its own
        return worker.submit(lambda: asyncio.run(play())).result()


__all__ = ["POLICY_CHECKS", "PolicyCase", "check_decisions", "check_policy", "check_same_decisions"]
