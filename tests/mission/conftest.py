"""The sea rescue as a mission graph built by hand: the tests of this package need no compiler."""

from collections.abc import Iterator
from typing import Literal

import pytest

import lingjing
from lingjing.testing import declarations as m
from lingjing.testing import expressions as ex


def metres(value: float) -> ex.Number:
    return ex.Number(float(value), "m")


def point(*items: float) -> ex.Point:
    return ex.Point(tuple(metres(item) for item in items))


def prop(name: str, value: ex.Expr, relation: Literal["=", "~", "<="] = "=", hidden: bool = False) -> m.Property:
    return m.Property(name=name, value=value, relation=relation, hidden=hidden)


def when_mode(mode: str) -> m.Guard:
    return m.Guard(condition=ex.Binary("==", ex.Ref("mode", "mode"), ex.Symbol(mode)))


def exists_report(rule: str) -> ex.Quantified:
    call = ex.Call(rule, (ex.Ref("v", "local"), ex.Ref("r", "local")), rule=True)
    return ex.Quantified("exists", "r", "detection", call)


SEARCH = ((665.1, -1081.1), (-123.7, -1100.5), (-123.7, -750.2), (665.1, -754.9))
PADS = ((306.6, -620.2, 1.1), (310.0, -590.1, 1.1), (278.7, -590.1, 1.1))
BOUNDED = m.Argument(name="distance", dimension="m", minimum=metres(0), maximum=metres(50))


def ssr_mission() -> m.Mission:
    i, v = ex.Ref("i", "local"), ex.Ref("v", "local")
    pads = ex.Call("at", (i, ex.Sequence(tuple(point(*pad) for pad in PADS))), (("spread", metres(8)),))
    sites = ex.Draw("sites", (ex.Ref("search", "region"),), (("apart", metres(80)),))
    uav_i = ex.Index(ex.Ref("uav", "group"), i)
    return m.Mission(
        name="ssr",
        title="Sea search and rescue",
        goal="Find every person in the water and bring the lifeboat to each of them.",
        scene=m.Scene(kind="bay", options=(prop("datum_m", metres(-3.5)),)),
        clock=m.ClockDeclaration(tick=ex.Number(10.0, "s"), sync=ex.Number(0.5, "s")),
        budget=m.BudgetDeclaration(
            ticks=ex.Number(60.0),
            policy=ex.Number(90.0, "s"),
            engine=ex.Number(30.0, "s"),
            capture=ex.Number(10.0, "s"),
        ),
        weather=(
            prop("wind_mps", ex.Number(4.0, "m/s")),
            prop("wind_from_deg", ex.Number(220.0, "deg")),
            prop("visibility_m", ex.Number(8000.0, "km")),
            prop("wave_height_m", ex.Draw("uniform", (metres(0.2), metres(0.8))), "~"),
        ),
        parameters=(
            m.Parameter(name="uavs", default=ex.Number(3.0), bounds=ex.Range(ex.Number(1.0), ex.Number(10.0))),
            m.Parameter(name="victims", default=ex.Number(3.0), bounds=ex.Range(ex.Number(1.0), ex.Number(6.0))),
            m.Parameter(name="altitude", default=metres(100.0), bounds=ex.Range(metres(40.0), metres(160.0))),
        ),
        modes=m.Modes(default="broadcast", allowed=("star", "broadcast")),
        regions=(
            m.RegionDeclaration(name="search", shape=ex.Call("polygon", tuple(point(*corner) for corner in SEARCH))),
        ),
        grids=(
            m.Grid(
                name="cells", region="search", rows=ex.Number(3.0), columns=ex.Number(3.0), overlap=ex.Number(0.2, "%")
            ),
        ),
        groups=(
            m.Group(
                name="victim",
                role="target",
                type="person_in_water",
                engine="city",
                count=ex.Ref("victims", "param"),
                properties=(prop("position", sites, "~", hidden=True), prop("drift_mps", ex.Number(0.1, "m/s"))),
            ),
            m.Group(
                name="uav",
                role="asset",
                type="quadrotor",
                engine="multirotor",
                count=ex.Ref("uavs", "param"),
                properties=(prop("position", pads), prop("band_low_m", metres(20)), prop("band_high_m", metres(160))),
                cameras=(
                    m.Camera(
                        name="nadir",
                        view="nadir",
                        width=ex.Number(1920.0),
                        height=ex.Number(1080.0),
                        hfov=ex.Number(84.0, "deg"),
                        channels=("rgb", "depth", "semantic"),
                    ),
                ),
                verbs=(m.Verb(name="stop"), m.Verb(name="forward", arguments=(BOUNDED,))),
            ),
            m.Group(
                name="boat",
                role="asset",
                type="lifeboat",
                engine="vessel",
                properties=(
                    prop("position", point(12.4, -1351.8)),
                    prop("heading_deg", ex.Number(30.0, "deg")),
                    prop("speed_mps", ex.Number(3.0, "m/s"), "<="),
                ),
                verbs=(m.Verb(name="moveTo"),),
            ),
        ),
        agents=(
            m.Agent(
                name="scout",
                role="searcher",
                count=ex.Ref("uavs", "param"),
                controls=(uav_i,),
                observes=(
                    m.Channel(source=uav_i),
                    m.Channel(source=ex.Ref("cells", "grid")),
                    m.Channel(source=ex.Symbol("peers"), fields=("position",)),
                    m.Channel(source=ex.Symbol("events")),
                ),
            ),
            m.Agent(
                name="skipper",
                role="rescuer",
                controls=(ex.Ref("boat", "group"),),
                observes=(m.Channel(source=ex.Ref("boat", "group")), m.Channel(source=ex.Symbol("events"))),
            ),
            m.Agent(
                name="commander",
                role="coordinator",
                observes=(m.Channel(source=ex.Symbol("cells")),),
                when=when_mode("star"),
            ),
        ),
        authorities=(m.Authority(role="searcher", resource=ex.Ref("boat", "group"), when=when_mode("broadcast")),),
        messages=(
            m.MessageKind(
                name="detection",
                type="report",
                category="report",
                fields=(),
                senders=("searcher",),
                recipients=("all",),
            ),
            m.MessageKind(
                name="assignment",
                type="assignment",
                category="assignment",
                fields=(m.Field(name="assignee", type="name"),),
                senders=("coordinator", "searcher"),
                recipients=("all",),
            ),
        ),
        comms=m.Comms(hub="commander", delay=ex.Number(1.0, "tick"), payload=ex.Number(4000.0, "kB")),
        rules=(
            m.Rule(
                name="reported",
                parameters=(m.RuleParameter(name="v", domain="victim"), m.RuleParameter(name="r", domain="detection")),
                condition=ex.Binary("in", ex.Attr(ex.Ref("r", "local"), "position"), ex.Ref("search", "region")),
            ),
            m.Rule(
                name="rescued",
                parameters=(m.RuleParameter(name="v", domain="victim"),),
                condition=ex.Binary("<=", ex.Call("distance_xy", (ex.Ref("boat", "group"), v)), metres(50)),
            ),
        ),
        unlocks=(),
        stages=(m.Stage(name="locate", condition=exists_report("reported"), variable="v", domain="victim"),),
        relations=(
            m.Relation(kind="cooperation", source="searcher", target="searcher", mutual=True, over="cells"),
            m.Relation(
                kind="guidance", source="coordinator", target="searcher", by="assignment", when=when_mode("star")
            ),
        ),
        success=ex.Quantified("forall", "v", "victim", ex.Call("rescued", (v,), rule=True)),
    )


@pytest.fixture(scope="session")
def ssr() -> m.Mission:
    return ssr_mission()


@pytest.fixture(scope="module")
def session() -> Iterator[lingjing.Session]:
    """A session for all episodes of a module: its camera prepares the same city once."""
    with lingjing.Session() as opened:
        yield opened
