"""What this distribution offers through the entry-point group `lingjing`; the policies load when they are asked for."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from inspect import Parameter, Signature

from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.policy import Policy, PolicyPlugin, UsageError

REACT_OPTIONS = (
    "model", "base_url", "base_url_env", "api_key_env", "client", "temperature", "max_tokens", "deadline", "repairs",
    "tries", "history", "image_side", "images", "vision", "schema", "price_in", "price_out",
)  # fmt: skip


@hookimpl
def lingjing_policies() -> Iterable[PolicyPlugin]:
    """The five reference policies."""
    return (
        PolicyPlugin(
            name="random",
            factory=Factory("random", "chance", "RandomPolicy"),
            summary="valid verbs with random arguments: the floor of every table",
        ),
        PolicyPlugin(
            name="heuristic",
            factory=Factory("heuristic", "heuristic.policy", "HeuristicPolicy"),
            summary="sweeps its cells and finds people in the pixels",
        ),
        PolicyPlugin(
            name="oracle",
            factory=Factory("oracle", "oracle", "OraclePolicy"),
            privileged=True,
            summary="reads the truth: shows that a mission can be won",
        ),
        PolicyPlugin(
            name="react",
            factory=Factory("react", "react.policy", "ReactPolicy", REACT_OPTIONS),
            summary="perceives, reasons and acts over a chat model",
        ),
        PolicyPlugin(
            name="scripted",
            factory=Factory("scripted", "replay", "ScriptedPolicy", ("script",)),
            summary="replays decisions from a JSON file (script=PATH)",
        ),
    )


@dataclass(frozen=True, slots=True)
class Factory:
    """Imports a policy's module when the first one is built; its signature tells which `--policy-arg` it takes."""

    name: str
    module: str
    attribute: str
    options: tuple[str, ...] = ()

    @property
    def __signature__(self) -> Signature:
        return Signature([Parameter(option, Parameter.KEYWORD_ONLY, default="") for option in self.options])

    def __call__(self, **arguments: str) -> Policy:
        """One policy object. Raises `UsageError` for an argument that it does not take or that is wrong."""
        for argument in arguments:
            if argument not in self.options:
                raise UsageError(
                    f"policy `{self.name}` takes no argument `{argument}`",
                    hint=f"it takes {', '.join(self.options) or 'none'}",
                )
        policy: Policy = getattr(import_module(f"lingjing_agents.{self.module}"), self.attribute)(**arguments)
        return policy
