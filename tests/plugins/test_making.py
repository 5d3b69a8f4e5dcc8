"""The hooks that make policies and evaluators: pluggy's order, its first result and its wrappers."""

from __future__ import annotations

import asyncio
import types

import pytest

from lingjing.errors import PluginError
from lingjing.plugins.evaluator import Evaluation, EvaluatorPlugin
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.policy import Decision, Observation, PolicyPlugin
from lingjing.testing import PluginHost, build_policy


class Idle:
    """A policy that returns its own name as its thought."""

    def __init__(self, name: str = "idle") -> None:
        self.name = name

    async def reset(self, brief: object) -> None:
        pass

    async def act(self, observation: Observation, inbox: object) -> Decision:
        return Decision(thought=self.name)


IDLE = PolicyPlugin(name="idle", factory=Idle)


def plugin(name: str, **hooks: object) -> types.ModuleType:
    module = types.ModuleType(name)
    for hook, function in hooks.items():
        setattr(module, hook, function)
    return module


def maker(name: str, **order: bool) -> types.ModuleType:
    """A plug-in that makes every policy `idle` itself."""

    @hookimpl(**order)
    def make(declaration: PolicyPlugin) -> Idle | None:
        return Idle(name) if declaration.name == "idle" else None

    make.__name__ = "lingjing_make_policy"
    return plugin(name, lingjing_make_policy=make)


def decorator(name: str) -> types.ModuleType:
    """A plug-in that wraps the thought of every policy in its own name."""

    class Around:
        def __init__(self, policy: Idle) -> None:
            self.policy = policy

        async def reset(self, brief: object) -> None:
            await self.policy.reset(brief)

        async def act(self, observation: Observation, inbox: object) -> Decision:
            inner = await self.policy.act(observation, inbox)
            return Decision(thought=f"{name}({inner.thought})")

    @hookimpl(wrapper=True)
    def lingjing_make_policy(declaration: PolicyPlugin):
        policy = yield
        return Around(policy)

    return plugin(name, lingjing_make_policy=lingjing_make_policy)


def thought(*plugins: types.ModuleType, declaration: PolicyPlugin = IDLE) -> str:
    host = PluginHost(entry_points=False, extra=plugins)
    policy = build_policy(declaration, {}, host=host)
    return asyncio.run(policy.act(Observation(agent="a", tick=0, time_s=0.0), None)).thought


def test_without_makers_the_factory_makes_the_policy() -> None:
    assert thought() == "idle"


def test_the_first_plugin_that_makes_a_policy_decides() -> None:
    assert thought(maker("early"), maker("late")) == "late", "pluggy calls the last registered first"
    assert thought(maker("early", tryfirst=True), maker("late")) == "early"
    assert thought(maker("early"), maker("late", trylast=True)) == "early"


def test_a_maker_that_returns_none_leaves_the_policy_to_the_factory() -> None:
    other = PolicyPlugin(name="other", factory=lambda: Idle("other"))
    assert thought(maker("early"), declaration=other) == "other"


def test_wrappers_wrap_the_policy_of_any_maker() -> None:
    assert thought(decorator("log"), maker("mine")) == "log(mine)"
    assert thought(decorator("inner"), decorator("outer")) == "outer(inner(idle))"


def test_a_maker_that_fails_is_named() -> None:
    @hookimpl(wrapper=True)
    def lingjing_make_policy():
        yield
        raise RuntimeError("no licence")

    with pytest.raises(PluginError, match=r"plug-ins that make policies: broken\): RuntimeError: no licence"):
        thought(plugin("broken", lingjing_make_policy=lingjing_make_policy))


def test_makers_are_listed_with_their_order() -> None:
    host = PluginHost(entry_points=False, extra=(maker("one"), maker("two"), maker("three", trylast=True)))
    assert host.makers("lingjing_make_policy") == ("two", "one", "three")
    assert host.made_by("lingjing_make_policy") == {"two": "two", "one": "one", "three": "three"}
    assert host.makers("lingjing_make_evaluator") == ()


def test_an_evaluator_can_be_wrapped() -> None:
    class Half:
        def __init__(self, inner: object) -> None:
            self.inner = inner

        def evaluate(self, state: object, events: object) -> Evaluation:
            full = self.inner.evaluate(state, events)
            return Evaluation(reward=full.reward / 2, done=full.done)

    class Full:
        def evaluate(self, state: object, events: object) -> Evaluation:
            return Evaluation(reward=1.0, done=True)

    @hookimpl(wrapper=True)
    def lingjing_make_evaluator():
        made = yield
        return Half(made)

    host = PluginHost(entry_points=False, extra=(plugin("half", lingjing_make_evaluator=lingjing_make_evaluator),))
    declaration = EvaluatorPlugin(name="full", build=lambda instance: Full())
    evaluator = host.make_evaluator(declaration, None, None)
    assert evaluator.evaluate(None, ()) == Evaluation(reward=0.5, done=True)


def test_an_offering_hook_cannot_be_wrapped() -> None:
    @hookimpl(wrapper=True)
    def lingjing_policies():
        return (yield)

    with pytest.raises(PluginError, match="plug-in `greedy`: lingjing_policies cannot be wrapped"):
        PluginHost(entry_points=False, extra=(plugin("greedy", lingjing_policies=lingjing_policies),))


def test_a_maker_with_another_parameter_is_refused_when_it_is_registered() -> None:
    @hookimpl
    def lingjing_make_policy(policy: object) -> None:
        return None

    with pytest.raises(Exception, match="policy"):
        PluginHost(entry_points=False, extra=(plugin("odd", lingjing_make_policy=lingjing_make_policy),))
