"""What this distribution offers through the entry-point group `lingjing`; the policies load when they are asked for."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module

from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.policy import Policy, PolicyPlugin, UsageError


@hookimpl
def lingjing_policies() -> Iterable[PolicyPlugin]:
    """The five reference policies."""
    return (
        _declare("random", "chance:RandomPolicy", "valid verbs with random arguments: the floor of every table"),
        _declare("heuristic", "heuristic.policy:HeuristicPolicy", "sweeps its cells and finds people in the pixels"),
        _declare("oracle", "oracle:OraclePolicy", "reads the truth: shows that a mission can be won", privileged=True),
        _declare("react", "react.policy:ReactPolicy", "perceive, reason, act over a chat model"),
        _declare("scripted", "replay:ScriptedPolicy", "replays decisions from a JSON file (script=PATH)"),
    )


def _declare(name: str, target: str, summary: str, *, privileged: bool = False) -> PolicyPlugin:
    module, _, attribute = target.partition(":")

    def factory(**arguments: str) -> Policy:
        policy_class = getattr(import_module(f"lingjing_agents.{module}"), attribute)
        known = tuple(policy_class.OPTIONS)
        for argument in arguments:
            if argument not in known:
                raise UsageError(
                    f"policy `{name}` takes no argument `{argument}`",
                    hint=f"it takes {', '.join(known) or 'none'}",
                )
        policy: Policy = policy_class(**arguments)
        return policy

    return PolicyPlugin(name=name, factory=factory, privileged=privileged, summary=summary)
