"""Wrong results of hooks and scenes of plug-ins: each error names the plug-in and the hook."""

from __future__ import annotations

import re

import pytest

from lingjing.cli.plugins import offers
from lingjing.errors import PluginError
from lingjing.mission.instance import SceneSpec
from lingjing.plugins.building import build_city
from lingjing.plugins.chat_model import ModelPlugin
from lingjing.plugins.engine import EnginePlugin
from lingjing.plugins.evaluator import EvaluatorPlugin
from lingjing.plugins.hookspecs import ScenePlugin, hookimpl
from lingjing.plugins.policy import PolicyPlugin
from lingjing.testing import PluginHost

KINDS = [
    ("lingjing_engines", EnginePlugin, "factory"),
    ("lingjing_policies", PolicyPlugin, "factory"),
    ("lingjing_scenes", ScenePlugin, "build"),
    ("lingjing_evaluators", EvaluatorPlugin, "build"),
]


def offering(hook: str, offered: object) -> PluginHost:
    """A host with the plug-in `Stranger`. Its `hook` returns `offered`."""
    function = staticmethod(hookimpl(lambda: offered, specname=hook))
    return PluginHost(entry_points=False, extra=(type("Stranger", (), {hook: function, "__name__": "Stranger"}),))


@pytest.mark.parametrize(("hook", "kind", "maker"), KINDS)
def test_a_hook_that_returns_a_wrong_value_is_named_with_its_plugin(hook: str, kind: type, maker: str) -> None:
    start = f"plug-in `Stranger` failed in {hook}: "
    named = f"{'an' if kind.__name__[0] == 'E' else 'a'} {kind.__name__}"
    wrong = [
        (("three",), f"it offers 'three', which is no {kind.__name__}"),
        ((kind(3, len),), f"the name of {named} is 3"),
        ((kind("", len),), f"the name of {named} is ''"),
        ((kind("two words", len),), f"the name of {named} is 'two words'"),
        ((kind("deaf", 3),), f"`{maker}` of `deaf` cannot be called"),
        (3, f"it returned a value of type `int`, and a list of {kind.__name__} is due"),
        (None, f"it returned None, and a list of {kind.__name__} is due"),
        ("three", f"it returned the text 'three', and a list of {kind.__name__} is due"),
    ]
    for offered, message in wrong:
        with pytest.raises(PluginError) as caught:
            offering(hook, offered)
        assert str(caught.value) == start + message
    right = dict if kind is EnginePlugin else len
    assert offering(hook, (kind("right", right),)).sources == {(hook, "right"): "Stranger"}


def _two(instance: object, options: object) -> None: ...


def _one(instance: object) -> None: ...


class _Calling:
    def __init__(self, options: object, calls: object) -> None: ...


@pytest.mark.parametrize(
    ("hook", "declaration", "takes"),
    [
        ("lingjing_evaluators", EvaluatorPlugin("mine", _two), "(instance, options), and it is called with (instance)"),
        ("lingjing_evaluators", EvaluatorPlugin("mine", _one, options="a:B"), "and it is called with (instance, optio"),
        ("lingjing_policies", PolicyPlugin("mine", _Calling, options="a:B"), "calls), and it is called with (options)"),
        ("lingjing_engines", EnginePlugin("mine", _one), "(instance), and it is called with ()"),
        ("lingjing_scenes", ScenePlugin("mine", _two), "(instance, options), and it is called with (spec)"),
    ],
)
def test_a_function_with_wrong_parameters_is_reported_with_both_lists(
    hook: str, declaration: object, takes: str
) -> None:
    with pytest.raises(PluginError) as caught:
        offering(hook, [declaration])
    assert re.match(f"plug-in `Stranger` failed in {hook}: `(build|factory)` of `mine` takes \\(", str(caught.value))
    assert takes in str(caught.value)


def test_functions_with_matching_parameters_are_accepted() -> None:
    offering("lingjing_policies", [PolicyPlugin("mine", _Calling, options="a:B", calls=True)])
    offering("lingjing_policies", [PolicyPlugin("mine", _one)])
    offering("lingjing_evaluators", [EvaluatorPlugin("mine", lambda instance, options=None: None)])


def test_models_are_listed_by_name_with_their_prices() -> None:
    models = (
        ModelPlugin("large-1", "react", {"model": "large-1"}, "commercial", 1.25, 10.0),
        ModelPlugin("small-1", "react", tier="open", price_in=0.0, price_out=0.0),
        ModelPlugin("other-1", "react"),
    )
    host = offering("lingjing_models", models)
    assert list(host.models) == ["large-1", "other-1", "small-1"]
    notes = {offer.name: offer.notes for offer in offers(host, [])}
    assert notes["large-1"] == "commercial, $1.25 in and $10 out a million tokens"
    assert (notes["small-1"], notes["other-1"]) == ("open, free", "open, price unknown")


def test_a_value_that_is_no_model_is_an_error_when_the_models_are_read() -> None:
    host = offering("lingjing_models", ("large-1",))
    with pytest.raises(PluginError, match=r"failed in lingjing_models: it offers 'large-1', which is no ModelPlugin"):
        host.models  # noqa: B018


def _fall(spec: SceneSpec) -> object:
    raise ValueError("no river")


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (_fall, "ValueError: no river (tests/plugins/test_declarations.py:111)"),
        (lambda spec: None, "it built None, no City"),
    ],
)
def test_a_scene_that_cannot_be_built_is_named(build: object, message: str) -> None:
    host = offering("lingjing_scenes", [ScenePlugin("canyon", build)])  # type: ignore[arg-type]
    with pytest.raises(PluginError) as caught:
        build_city(SceneSpec(kind="canyon", seed=0), host)
    assert str(caught.value) == f"scene `canyon` of plug-in `Stranger` failed: {message}"
