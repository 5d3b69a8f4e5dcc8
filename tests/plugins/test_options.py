"""Declared options: what is listed of them, what is read, and that every fault is told at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Literal

import pytest
from pydantic import AliasChoices, field_validator

from lingjing.errors import PluginError, UsageError
from lingjing.plugins.engine import EnginePlugin
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import build_policy, engine_options, policy_of, share_arguments
from lingjing.plugins.options import (
    Field,
    PluginOptions,
    declared_model,
    model_of_parameters,
    option_faults,
    option_specs,
    read_options,
)


class Flight(PluginOptions):
    height_m: float = Field(80.0, alias="height", ge=20.0, le=120.0, description="metres above the ground")
    rounds: int = Field(1, ge=1)
    pattern: Literal["lawn", "spiral"] = "lawn"
    names: list[str] = []
    quick: bool = False
    place: str


class Scout:
    options = Flight

    def __init__(self, options: Flight) -> None:
        self.flight = options

    async def reset(self, brief): ...

    async def act(self, observation, inbox): ...


def test_texts_are_read_as_what_they_are_declared_to_be():
    read = read_options(Flight, {"height": "60", "rounds": "3", "quick": "yes", "place": "pier"}, "policy `scout`")
    assert (read.height_m, read.rounds, read.quick, read.pattern, read.place) == (60.0, 3, True, "lawn", "pier")


def test_every_fault_is_told_at_once_at_the_options_spelling():
    given = {"height": "10", "rounds": "often", "pattern": "zigzag", "qiuck": "yes", "names": "a"}
    with pytest.raises(UsageError) as caught:
        read_options(Flight, given, "policy `scout`")
    assert {fault.where: fault.message for fault in caught.value.faults} == {
        "height": "is '10', at least 20 is due",
        "rounds": "is 'often', a whole number is due",
        "pattern": "is 'zigzag', 'lawn' or 'spiral' is due",
        "names": "is 'a', a list is due",
        "place": "is missing",
        "qiuck": "is not known",
    }
    assert "policy `scout`: option `qiuck` is not known; did you mean `quick`?" in str(caught.value)
    assert caught.value.hint == "`lingjing plugins scout` lists the options"


def test_a_nested_fault_has_its_path():
    class Retry(PluginOptions):
        tries: int = 3

    class Service(PluginOptions):
        retry: Retry = Retry()

    assert [one.where for one in option_faults(Service, {"retry": {"tries": "x", "wait": 1}})] == [
        "retry.tries",
        "retry.wait",
    ]


def test_what_was_given_is_not_repeated_when_it_may_be_a_secret():
    key = "Zq8vT3kX9-mWn2bLs77RxZq8vT3kX"
    with pytest.raises(UsageError) as caught:
        read_options(Flight, {"rounds": key, "place": "pier"}, "policy `scout`")
    assert key not in str(caught.value)
    assert caught.value.__context__ is None  # pydantic's own error holds it


def test_options_are_listed_with_type_bounds_default_and_help():
    listed = {one.name: one for one in option_specs(Flight)}
    assert list(listed) == ["height", "rounds", "pattern", "names", "quick", "place"]
    height = listed["height"]
    assert (height.type, height.bounds, height.default, height.help) == (
        "number",
        "20 to 120",
        "80",
        "metres above the ground",
    )
    assert (listed["pattern"].bounds, listed["names"].type, listed["quick"].default) == (
        "lawn, spiral",
        "list of text",
        "no",
    )
    assert [one.name for one in listed.values() if one.required] == ["place"]


def test_what_json_schema_cannot_express_is_listed_as_any(recwarn):
    class Callback(PluginOptions):
        f: Callable[[], int]
        g: Callable[[], int] = lambda: 1
        height: float = 80.0

    def made(clock: Scout, wait: object = Scout): ...

    listed = {one.name: one for one in option_specs(Callback)}
    assert [(one.type, one.required) for one in listed.values()] == [("any", True), ("any", False), ("number", False)]
    assert [(one.name, one.type) for one in option_specs(model_of_parameters(made))] == [
        ("clock", "any"),
        ("wait", "any"),
    ]
    assert not recwarn.list


def test_a_validator_that_breaks_is_a_fault_of_its_option():
    class Share(PluginOptions):
        rounds: int = 1
        parts: int = 1

        @field_validator("parts")
        @classmethod
        def divided(cls, parts: int) -> int:
            return 10 // parts

    with pytest.raises(UsageError, match=r"policy `scout`: option `parts` cannot be checked: its validator") as caught:
        read_options(Share, {"rounds": "2", "parts": "0"}, "policy `scout`")
    assert "ZeroDivisionError at test_options.py:" in str(caught.value)
    assert [one.where for one in option_faults(Share, {"parts": "0", "rounds": "x"})] == ["parts"]


def test_an_option_is_given_by_the_alias_that_it_is_listed_under():
    class Aliased(PluginOptions):
        key_file: str = Field("", validation_alias="key-file")
        wait: int = Field(1, validation_alias=AliasChoices("pause", "wait-s"))

    class Made(Scout):
        options = Aliased

    assert [one.name for one in option_specs(Aliased)] == ["key-file", "pause"]
    given = {"key-file": "x", "wait-s": "2"}
    assert share_arguments({"made": policy_of(Made, "made")}, given) == {"made": given}


def test_a_model_is_found_by_its_name_when_it_is_needed():
    assert declared_model(f"{__name__}:Flight", "policy `scout`") is Flight
    assert declared_model(None, "policy `scout`") is None
    with pytest.raises(PluginError, match=r"options of policy `scout` cannot be loaded from `no_such_module:Flight`"):
        declared_model("no_such_module:Flight", "policy `scout`")
    with pytest.raises(PluginError, match="no model of options"):
        declared_model(f"{__name__}:Scout", "policy `scout`")


def test_a_model_whose_types_are_unknown_is_its_authors_mistake():
    class Torn(PluginOptions):
        height: Unheard  # noqa: F821

    with pytest.raises(PluginError, match="options of policy `scout` cannot be read from `Torn`: name 'Unheard'"):
        declared_model(Torn, "policy `scout`")


def test_parameters_are_options_where_no_model_is_declared():
    def scout(height: Annotated[float, Field(ge=20.0, description="metres")] = 80.0, schema="x", **others): ...

    model = model_of_parameters(scout)
    height, schema = option_specs(model)
    assert (height.name, height.type, height.bounds, height.help) == ("height", "number", "at least 20", "metres")
    assert (schema.name, schema.type, schema.default) == ("schema", "any", "x")
    assert [fault.where for fault in option_faults(model, {"height": "3", "speed": "5"})] == ["height"]


def test_a_class_says_by_attribute_which_model_it_takes():
    plugin = policy_of(Scout, "scout")
    policy = build_policy(plugin, {"place": "pier", "height": "100"})
    assert isinstance(policy, Scout)
    assert policy.flight.height_m == 100.0


def test_the_faults_of_several_policies_are_told_together():
    def other(gamma: int = 1): ...

    plugins = {"scout": policy_of(Scout, "scout"), "other": policy_of(other, "other")}
    with pytest.raises(UsageError) as caught:
        share_arguments(plugins, {"gamma": "x", "higth": "3"})
    assert str(caught.value).splitlines() == [
        "policy `scout`: option `place` is missing",
        "policy `other`: option `gamma` is 'x', a whole number is due",
        "policies `scout`, `other`: option `higth` is not known; did you mean `height`?",
    ]


class Bridge(PluginOptions):
    host: str = "localhost"
    port: int = Field(41451, ge=1, le=65535)


class _Engines:
    @hookimpl
    def lingjing_engines(self):
        return [
            EnginePlugin(name="bridge", factory=object, place="remote", options=f"{__name__}:Bridge"),
            EnginePlugin(name="kite", factory=object),
        ]


def test_what_engines_are_told_is_shared_among_them():
    host = PluginHost(entry_points=False, extra=[_Engines()])
    given = {"bridge.host": "gpu.local", "bridge.port": "5000"}
    assert engine_options(given, host) == {"bridge": {"host": "gpu.local", "port": "5000"}}
    assert engine_options({}, host) == {}


def test_an_engine_that_takes_part_must_be_given_what_it_requires():
    class Engines:
        @hookimpl
        def lingjing_engines(self):
            return [EnginePlugin(name="far", factory=object, options=f"{__name__}:Flight")]

    host = PluginHost(entry_points=False, extra=[Engines()])
    assert engine_options({}, host) == {}
    with pytest.raises(UsageError, match="engine `far`: option `place` is missing"):
        engine_options({}, host, used=["far"])


def test_every_fault_of_what_engines_are_told_is_told_at_once():
    host = PluginHost(entry_points=False, extra=[_Engines()])
    with pytest.raises(UsageError) as caught:
        engine_options(
            {"bridge.port": "0", "bridge.hots": "x", "brigde.port": "1", "kite.line": "2", "kite": "3"}, host
        )
    assert [(fault.where, fault.hint) for fault in caught.value.faults] == [
        ("brigde.port", "did you mean `bridge`?"),
        ("kite", "did you mean `kite`?"),
        ("port", ""),
        ("hots", "did you mean `host`?"),
        ("line", "known: none"),
    ]
