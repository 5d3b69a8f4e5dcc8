"""States in rules and observations: demand and load as the engines report them, routes, no internal accounts."""

import msgspec
import pytest

from lingjing.kernel.stocks import current, stocks
from lingjing.mission.instance import ChannelSpec, StateSpec
from lingjing.testing import rescue as kit
from lingjing.testing.expressions import Aggregate, Attr, Binary, Number
from lingjing.trace.records import BodyState, Route

LOAD = StateSpec(name="load", unit="kg")
VAN = kit.entity("van", 0.0, 0.0, properties={"load_kg": 200.0, "payload_kg": 200.0, "heat": 1.0}, state=(LOAD,))
WAY = ((0.0, 0.0, 0.0), (50.0, 0.0, 0.0))


def state(**resources):
    return BodyState(id="van", position=(0.0, 0.0, 0.0), resources=resources)


@pytest.mark.parametrize(
    ("resources", "load"), [({}, 200.0), ({"load": 50.0}, 50.0), ({"load_kg": 0.0}, 0.0), ({"battery": 1.0}, 200.0)]
)
def test_the_value_of_the_engine_overrides_the_declared_value(resources, load):
    assert current(VAN, state(**resources), "load_kg") == load
    assert stocks(VAN, state(**resources))["load"] == load
    assert current(VAN, state(**resources), "payload_kg") == 200.0
    assert current(VAN, state(), "colour") is None


def test_a_property_that_is_no_state_is_not_read_from_resources():
    assert current(VAN, state(payload=1.0), "payload_kg") == 200.0


def test_stocks_contain_no_hidden_and_no_internal_values():
    closed = msgspec.structs.replace(VAN, hidden=("load_kg",))
    assert stocks(VAN, state(**{"load": 1.0, "water@truck": 5.0, "battery": 0.5})) == {"load": 1.0, "battery": 0.5}
    assert stocks(closed, state(load=1.0, battery=0.5)) == {}, "a battery lasts as long as the load lets it"


class Porter(kit.PointMasses):
    """An engine that unloads 10 kg per tick, keeps an internal account and publishes a route."""

    def advance(self, until, mirrors):
        boundary = super().advance(until, mirrors)
        load = {"load": 200.0 - until, "grain@silo": -3.0, "battery": 0.5}
        boundary = msgspec.structs.replace(
            boundary,
            states=tuple(msgspec.structs.replace(state, resources=load) for state in boundary.states),
        )
        if until != 10.0:
            return boundary
        route = Route(entity="boat", number=1, waypoints=WAY, length_m=50.0, duration_s=5.0, time_s=until)
        return msgspec.structs.replace(boundary, routes=(route,))


def seen(*fields, source="entity", name="boat"):
    """Return the first scout's view of the boat at boundary 1 through channels of these fields."""
    channels = tuple(ChannelSpec(source=source, name=name, fields=(field,)) for field in fields)
    base = kit.instance()
    crew = tuple(
        msgspec.structs.replace(agent, observes=channels, commands=("uav[1]",)) if agent.id == "scout[1]" else agent
        for agent in base.agents
    )
    about = {"properties": {"load_kg": 200.0}, "state": (LOAD,)}
    fleet = tuple(msgspec.structs.replace(e, **about) if e.id == "boat" else e for e in base.entities)
    instance = msgspec.structs.replace(base, agents=crew, entities=fleet)
    kernel = kit.kernel(instance, kit.RescueEngines(glider=Porter))
    first = kernel.reset().observations["scout[1]"].entities
    return first, kernel.step(()).observations["scout[1]"].entities


def test_a_channel_of_one_state_shows_this_state_only():
    (before,), (view,) = seen("load_kg")
    assert (before.resources, view.resources) == ({"load": 200.0}, {"load": 190.0})
    assert (view.position, view.status, view.route, view.busy) == (None, None, None, None)


def test_several_channels_of_an_entity_are_combined():
    _, (view,) = seen("position", "load_kg", "busy")
    assert view.resources == {"load": 190.0}
    assert view.position is not None
    assert view.busy is False


def test_a_channel_of_all_fields_shows_everything_except_internal_accounts():
    _, (view,) = seen("*")
    assert view.resources == {"load": 190.0, "battery": 0.5}
    assert view.route == WAY
    _, (stock,) = seen("resources")
    assert (stock.resources, stock.route) == ({"load": 190.0, "battery": 0.5}, None)


def test_a_route_is_shown_as_soon_as_it_exists():
    (before,), (view,) = seen("route")
    assert (before.route, view.route, view.resources) == (None, WAY, None)


def test_peers_show_only_the_fields_of_their_channel():
    _, views = seen("position", source="peers", name="")
    assert {view.id: view.resources for view in views} == {"uav[2]": None, "boat": None}


def test_a_privileged_policy_does_not_see_internal_accounts():
    kernel = kit.kernel(plugin=kit.RescueEngines(glider=Porter), privileged=frozenset({"scout[1]"}))
    kernel.reset()
    truth = kernel.step(()).observations["scout[1]"].privileged
    assert {name for state in truth.states for name in state.resources} == {"load", "battery"}


def test_rules_sum_and_compare_current_states():
    total = Aggregate(function="sum", variable="v", domain="uav", body=Attr(base=kit.local("v"), name="load_kg"))
    empty = Binary(operator="<=", left=total, right=Number(value=380.0, unit="kg"))
    base = kit.instance()
    about = {"properties": {"load_kg": 200.0}, "state": (LOAD,)}
    fleet = tuple(msgspec.structs.replace(e, **about) if e.group == "uav" else e for e in base.entities)
    instance = msgspec.structs.replace(base, entities=fleet, rules=(kit.rule("light", empty),), success=empty)
    instance = msgspec.structs.replace(instance, unlocks=(), stages=())
    kernel = kit.kernel(instance, kit.RescueEngines(glider=Porter))
    assert not kernel.reset().evaluation.done  # 400 kg as declared
    assert kernel.step(()).evaluation.reason == "success"  # 190 and 190


def test_stocks_that_an_engine_derives_from_a_hidden_property_are_not_shown():
    """Watt-hours at the start derive from the hidden endurance; declared states stay visible."""
    closed = msgspec.structs.replace(VAN, hidden=("position", "endurance_s"))
    assert stocks(closed, state(load=1.0, battery_wh=120.0, battery=1.0)) == {"load": 1.0}
    placed = msgspec.structs.replace(VAN, hidden=("position",))
    assert stocks(placed, state(load=1.0, battery_wh=120.0)) == {"load": 1.0, "battery_wh": 120.0}
