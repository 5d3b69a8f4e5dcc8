"""Declared options: their listing, their reading, and the report of all faults at once."""

from __future__ import annotations

import enum
import json
from collections.abc import Callable
from typing import Annotated, Literal

import pytest
from pydantic import AliasChoices, field_validator

from lingjing.errors import PluginError, UsageError
from lingjing.option_listing import option_specs
from lingjing.play.option_sharing import engine_options, share_arguments
from lingjing.plugins.engine import EnginePlugin
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.loading import policy_of
from lingjing.plugins.options import (
    Field,
    PluginOptions,
    declared_model,
    model_of_parameters,
    option_faults,
    read_options,
)
from lingjing.testing import PluginHost, build_policy


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


def test_texts_are_converted_to_the_declared_types():
    read = read_options(Flight, {"height": "60", "rounds": "3", "quick": "yes", "place": "pier"}, "policy `scout`")
    assert (read.height_m, read.rounds, read.quick, read.pattern, read.place) == (60.0, 3, True, "lawn", "pier")


def test_the_model_of_parameters_is_built_once() -> None:
    def scout(height: int = 80) -> None: ...

    class Unhashable:
        __hash__ = None  # type: ignore[assignment]

        def __call__(self, height: int = 80) -> None: ...

    assert model_of_parameters(scout) is model_of_parameters(scout)
    assert model_of_parameters(Unhashable()).model_fields["option_0"].alias == "height"


def test_all_faults_are_reported_together_under_the_names_of_their_options():
    arguments = {"height": "10", "rounds": "often", "pattern": "zigzag", "qiuck": "yes", "names": "a"}
    with pytest.raises(UsageError) as caught:
        read_options(Flight, arguments, "policy `scout`")
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


def test_faults_that_contain_a_suggestion_have_no_further_hint():
    with pytest.raises(UsageError) as caught:
        read_options(Flight, {"place": "here", "qiuck": "yes"}, "policy `scout`")
    assert str(caught.value) == "policy `scout`: option `qiuck` is not known; did you mean `quick`?"
    assert caught.value.hint == ""


def test_the_hint_of_the_cause_of_a_validators_error_is_the_hint_of_the_fault():
    class Named(PluginOptions):
        name: str

        @field_validator("name")
        @classmethod
        def _is_there(cls, name: str) -> str:
            raise ValueError("is unknown") from UsageError("nothing is called so", hint="did you mean `b`?")

    with pytest.raises(UsageError, match=r"^thing: option `name` is unknown; did you mean `b`\?$"):
        read_options(Named, {"name": "a"}, "thing")


def test_a_plugin_error_raised_by_a_validator_is_reported_with_its_text_and_hint():
    class Named(PluginOptions):
        name: str

        @field_validator("name")
        @classmethod
        def _is_there(cls, name: str) -> str:
            raise PluginError("the options of scaffold `mine` cannot be loaded", hint="correct it")

    message = r"^thing: option `name` cannot be used: the options of scaffold `mine` cannot be loaded; correct it$"
    with pytest.raises(UsageError, match=message.replace("$", "")) as caught:
        read_options(Named, {"name": "a"}, "thing")
    assert caught.value.hint == ""


def test_a_nested_fault_has_its_path():
    class Retry(PluginOptions):
        tries: int = 3

    class Service(PluginOptions):
        retry: Retry = Retry()

    assert [fault.where for fault in option_faults(Service, {"retry": {"tries": "x", "wait": 1}})] == [
        "retry.tries",
        "retry.wait",
    ]


def test_a_value_that_may_be_a_secret_is_not_repeated_in_the_error():
    key = "Zq8vT3kX9-mWn2bLs77RxZq8vT3kX"
    with pytest.raises(UsageError) as caught:
        read_options(Flight, {"rounds": key, "place": "pier"}, "policy `scout`")
    assert key not in str(caught.value)
    assert caught.value.__context__ is None  # pydantic's own error holds it


def test_options_are_listed_with_type_bounds_default_and_help():
    listed = {spec.name: spec for spec in option_specs(Flight)}
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
    assert [spec.name for spec in listed.values() if spec.required] == ["place"]


class Colour(enum.Enum):
    RED = "red"
    BLUE = "blue"


class Link(PluginOptions):
    host: str = Field(min_length=3)
    port: int = Field(80, ge=1, le=65535)


class Wide(PluginOptions):
    """An option of every shape."""

    colours: list[Colour] = Field([], min_length=1, max_length=4)
    names: set[str] = set()
    pair: tuple[int, float] = (1, 2.0)
    limits: dict[str, Annotated[float, Field(gt=0)]] = {}
    link: Link | None = None
    rounds: Literal[1, 2, 4] = 1
    step: int = Field(5, multiple_of=5)
    name: str = Field("", max_length=8, pattern="^[a-z]*$")
    either: int | list[int] = 1
    free: str | list[str] = ""


def test_texts_that_an_option_cannot_take_are_read_as_json():
    texts = {
        "colours": '["red", "blue"]', "names": '["a", "b", "a"]', "pair": "[3, 4]", "limits": '{"x": 2}',
        "link": '{"host": "gpu.local"}', "rounds": "4", "step": "10", "name": "abc", "either": "[1, 2]",
        "free": "[1, 2]",
    }  # fmt: skip
    read = read_options(Wide, texts, "policy `scout`")
    assert (read.colours, read.names, read.pair) == ([Colour.RED, Colour.BLUE], {"a", "b"}, (3, 4.0))
    assert (read.limits, read.link, read.rounds) == ({"x": 2.0}, Link(host="gpu.local"), 4)
    assert (read.step, read.name, read.either) == (10, "abc", [1, 2])
    assert read.free == "[1, 2]"  # the option accepts texts
    values = {name: json.loads(text) if text[0] in "[{" or text.isdigit() else text for name, text in texts.items()}
    again = read_options(Wide, {**values, "free": ["x"]}, "policy `scout`")
    assert again == read.model_copy(update={"free": ["x"]})
    assert read_options(Wide, {"link": "null"}, "policy `scout`").link is None


def test_faults_within_json_have_paths_and_other_texts_have_a_hint_to_write_json():
    texts = {
        "colours": '["red", "green"]', "names": "a, b", "pair": "[3]", "limits": '{"x": -2}', "link": '{"prt": 1}',
        "rounds": "3", "step": "7", "name": "Long name of it", "either": "x", "free": "x",
    }  # fmt: skip
    faults = {fault.where: (fault.message, fault.hint) for fault in option_faults(Wide, texts)}
    assert faults["colours.1"][0] == "is 'green', 'red' or 'blue' is due"
    assert faults["names"] == ("is 'a, b', a list is due", 'write it as JSON: ["a", "b"] or {"a": 1}')
    assert faults["pair.1"][0] == "is missing" and faults["limits.x"][0] == "is -2, more than 0 is due"
    assert faults["link.host"][0] == "is missing" and "link.prt" in faults
    assert faults["rounds"][0] == "is '3', 1, 2 or 4 is due" and "multiple of 5" in faults["step"][0]
    assert "at most 8" in faults["name"][0]
    assert faults["either"][0] == "is 'x', a whole number or a list is due"
    assert "free" not in faults and len(faults) == 10


def test_every_bound_is_listed():
    listed = {spec.name: (spec.type, spec.bounds) for spec in option_specs(Wide)}
    assert listed == {
        "colours": ("list of word", "1 or more, 4 at most, each red, blue"),
        "names": ("set of text", ""),
        "pair": ("list of whole number, number", "2 or more, 2 at most"),
        "limits": ("object of number", "each more than 0"),
        "link": ("object (host: text 3 letters or more, port: whole number 1 to 65535)", ""),
        "rounds": ("choice", "1, 2, 4"),
        "step": ("whole number", "a multiple of 5"),
        "name": ("text", "8 letters at most, like ^[a-z]*$"),
        "either": ("whole number or list of whole number", ""),
        "free": ("text or list of text", ""),
    }


def test_a_recursive_model_is_listed():
    class Tree(PluginOptions):
        below: list[Tree] = []

    assert [spec.type for spec in option_specs(Tree)] == ["list of object (below: list of object)"]


def test_types_that_json_schema_cannot_express_are_listed_as_any(recwarn):
    class Callback(PluginOptions):
        f: Callable[[], int]
        g: Callable[[], int] = lambda: 1
        height: float = 80.0

    def made(clock: Scout, wait: object = Scout): ...

    listed = {spec.name: spec for spec in option_specs(Callback)}
    assert [(spec.type, spec.required) for spec in listed.values()] == [
        ("any", True),
        ("any", False),
        ("number", False),
    ]
    assert [(spec.name, spec.type) for spec in option_specs(model_of_parameters(made))] == [
        ("clock", "any"),
        ("wait", "any"),
    ]
    assert not recwarn.list


def test_an_exception_in_a_validator_is_a_fault_of_its_option():
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
    assert [fault.where for fault in option_faults(Share, {"parts": "0", "rounds": "x"})] == ["parts"]


def test_an_option_is_listed_and_set_by_its_aliases():
    class Aliased(PluginOptions):
        key_file: str = Field("", validation_alias="key-file")
        wait: int = Field(1, validation_alias=AliasChoices("pause", "wait-s"))

    class Made(Scout):
        options = Aliased

    assert [spec.name for spec in option_specs(Aliased)] == ["key-file", "pause"]
    arguments = {"key-file": "x", "wait-s": "2"}
    assert share_arguments({"made": policy_of(Made, "made")}, arguments) == {"made": arguments}


def test_a_model_of_options_is_loaded_by_its_name():
    assert declared_model(f"{__name__}:Flight", "policy `scout`") is Flight
    assert declared_model(None, "policy `scout`") is None
    with pytest.raises(PluginError, match=r"options of policy `scout` cannot be loaded from `no_such_module:Flight`"):
        declared_model("no_such_module:Flight", "policy `scout`")
    with pytest.raises(PluginError, match="no model of options"):
        declared_model(f"{__name__}:Scout", "policy `scout`")


def test_a_model_with_an_unknown_type_is_a_plugin_error():
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


def test_the_attribute_options_of_a_class_declares_its_model():
    plugin = policy_of(Scout, "scout")
    policy = build_policy(plugin, {"place": "pier", "height": "100"})
    assert isinstance(policy, Scout)
    assert policy.flight.height_m == 100.0


def test_the_faults_of_several_policies_are_reported_together():
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


def test_engine_options_are_assigned_by_their_prefix():
    host = PluginHost(entry_points=False, extra=[_Engines()])
    arguments = {"bridge.host": "gpu.local", "bridge.port": "5000"}
    assert engine_options(arguments, host) == {"bridge": {"host": "gpu.local", "port": "5000"}}
    assert engine_options({}, host) == {}


def test_a_missing_required_option_is_an_error_only_for_an_engine_in_use():
    class Engines:
        @hookimpl
        def lingjing_engines(self):
            return [EnginePlugin(name="far", factory=object, options=f"{__name__}:Flight")]

    host = PluginHost(entry_points=False, extra=[Engines()])
    assert engine_options({}, host) == {}
    with pytest.raises(UsageError, match="engine `far`: option `place` is missing"):
        engine_options({}, host, used=["far"])


def test_all_faults_in_engine_options_are_reported_together():
    host = PluginHost(entry_points=False, extra=[_Engines()])
    with pytest.raises(UsageError) as caught:
        engine_options(
            {"bridge.port": "0", "bridge.hots": "x", "brigde.port": "1", "kite.line": "2", "kite": "3"}, host
        )
    assert [(fault.where, fault.hint) for fault in caught.value.faults] == [
        ("brigde.port", "did you mean `bridge`?"),
        ("kite", "write kite.OPTION"),
        ("port", ""),
        ("hots", "did you mean `host`?"),
        ("line", "known: none"),
    ]
