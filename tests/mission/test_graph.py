"""The mission graph: the graph of the sea rescue in both modes, and the nodes and edges that each declaration adds."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import msgspec
import pytest

import lingjing
from lingjing.errors import MissionError, UsageError
from lingjing.mission.expression_text import spell
from lingjing.mission.graph import EdgeKind, MissionGraph, NodeKind, graph
from lingjing.mission.graph.guards import presence
from lingjing.testing import declarations as m
from lingjing.testing import expressions as ex

SSR = Path(__file__).parents[2] / "scenarios" / "ssr.ljs"
V, R = ex.Ref("v", "local"), ex.Ref("r", "local")
STAR = m.Guard(condition=ex.Binary("==", ex.Ref("mode", "mode"), ex.Symbol("star")))

NODES = [
    "role:searcher", "role:rescuer", "agent:scout", "agent:skipper", "region:search", "grid:cells", "target:victim",
    "asset:uav", "asset:boat", "fact:victim.position", "resource:uav.endurance_s", "channel:comms",
    "channel:detection", "channel:assignment", "channel:progress", "rule:matched", "rule:reported", "rule:rescued",
    "event:rescue", "stage:detect", "stage:locate", "stage:handoff", "stage:execute", "outcome:success",
    "resource:budget.ticks", "channel:peers", "channel:events",
]  # fmt: skip

EDGES = """
plays agent:scout role:searcher
plays agent:skipper role:rescuer
requires grid:cells region:search
hides target:victim fact:victim.position
requires fact:victim.position region:search
requires asset:uav resource:uav.endurance_s
requires channel:detection channel:comms
requires channel:assignment channel:comms
requires channel:progress channel:comms
speaks_to role:searcher channel:detection
speaks_to role:searcher channel:assignment
speaks_to role:searcher channel:progress
speaks_to role:rescuer channel:progress
speaks_to channel:detection role:searcher
speaks_to channel:detection role:rescuer
speaks_to channel:assignment role:searcher
speaks_to channel:assignment role:rescuer
speaks_to channel:progress role:searcher
speaks_to channel:progress role:rescuer
controls agent:scout asset:uav
controls agent:skipper asset:boat
observes agent:scout asset:uav
observes agent:scout grid:cells
observes agent:scout channel:peers
observes agent:scout channel:events
observes agent:skipper asset:boat
observes agent:skipper channel:events
requires event:rescue target:victim
requires event:rescue asset:boat
unlocks rule:reported event:rescue
adjudicates rule:matched target:victim
adjudicates rule:reported target:victim
adjudicates rule:rescued target:victim
requires rule:matched channel:detection
requires rule:reported channel:detection
requires rule:reported rule:matched
requires rule:reported region:search
requires rule:rescued event:rescue
requires rule:rescued asset:boat
requires rule:rescued rule:reported
requires stage:detect rule:matched
requires stage:locate rule:reported
requires stage:handoff rule:reported
requires stage:handoff asset:boat
requires stage:handoff channel:assignment
requires stage:execute rule:rescued
requires outcome:success rule:rescued
requires outcome:success resource:budget.ticks
information_handoff role:searcher role:rescuer
cooperation role:searcher role:searcher
dependency stage:locate stage:execute
""".strip().splitlines()

ONLY_STAR = """
plays agent:commander role:coordinator
requires channel:comms agent:commander
speaks_to role:coordinator channel:assignment
speaks_to role:coordinator channel:progress
speaks_to channel:detection role:coordinator
speaks_to channel:assignment role:coordinator
speaks_to channel:progress role:coordinator
observes agent:commander asset:uav
observes agent:commander asset:boat
observes agent:commander grid:cells
observes agent:commander channel:events
guidance role:coordinator role:searcher
guidance role:coordinator role:rescuer
""".strip().splitlines()

ONLY_BROADCAST = [
    "may_command role:searcher asset:boat",
    "competition role:searcher role:searcher",
    "guidance role:searcher role:rescuer",
]


@pytest.fixture(scope="module")
def whole() -> m.Mission:
    """`scenarios/ssr.ljs`, compiled."""
    return lingjing.compile(SSR)


def ids(shown: MissionGraph) -> tuple[set[str], set[str]]:
    nodes, edges = [node.id for node in shown.nodes], [edge.id for edge in shown.edges]
    assert len(set(nodes)) == len(nodes)
    assert len(set(edges)) == len(edges)
    return set(nodes), set(edges)


def test_ssr_has_the_expected_graph_in_broadcast_mode(whole: m.Mission) -> None:
    nodes, edges = ids(graph(whole, "broadcast"))
    assert nodes == set(NODES)
    assert edges == {*EDGES, *ONLY_BROADCAST}


def test_ssr_has_the_expected_graph_in_star_mode(whole: m.Mission) -> None:
    nodes, edges = ids(graph(whole, "star"))
    assert nodes == {*NODES, "role:coordinator", "agent:commander"}
    assert edges == {*EDGES, *ONLY_STAR}


def test_the_graph_of_all_modes_is_the_union_with_guards(whole: m.Mission) -> None:
    shown = graph(whole)
    nodes, edges = ids(shown)
    assert nodes == {*NODES, "role:coordinator", "agent:commander"}
    assert edges == {*EDGES, *ONLY_STAR, *ONLY_BROADCAST}
    modes = {edge.id: edge.modes for edge in shown.edges}
    assert all(modes[edge] == ("star", "broadcast") for edge in EDGES)
    assert all(modes[edge] == ("star",) for edge in ONLY_STAR)
    assert all(modes[edge] == ("broadcast",) for edge in ONLY_BROADCAST)
    assert {part.id: part.when for part in (*shown.nodes, *shown.edges) if part.when} == {
        "role:coordinator": "mode == star",
        "agent:commander": "mode == star",
        "requires channel:comms agent:commander": "mode == star",
        "may_command role:searcher asset:boat": "mode == broadcast",
        "competition role:searcher role:searcher": "mode == broadcast",
        "guidance role:coordinator role:searcher": "mode == star",
        "guidance role:coordinator role:rescuer": "mode == star",
        "guidance role:searcher role:rescuer": "mode == broadcast",
    }


def test_the_graph_of_one_mode_has_no_guards(whole: m.Mission) -> None:
    for mode in ("star", "broadcast"):
        shown = graph(whole, mode)
        assert shown.modes == (mode,)
        assert not any(part.when for part in (*shown.nodes, *shown.edges))


def test_the_graph_is_deterministic_and_round_trips_as_json(whole: m.Mission) -> None:
    shown = graph(whole)
    assert graph(whole) == shown
    assert msgspec.json.decode(msgspec.json.encode(shown), type=MissionGraph) == shown


def test_a_group_is_one_node_with_a_count(whole: m.Mission) -> None:
    shown = graph(whole)
    assert (shown.node("asset:uav").title, shown.node("asset:uav").count) == ("uav[1..3]", 3)
    assert (shown.node("asset:boat").title, shown.node("asset:boat").count) == ("boat", None)
    drawn = ex.Draw("uniform", (ex.Number(1.0), ex.Number(9.0)))
    unknown = msgspec.structs.replace(
        whole, parameters=tuple(msgspec.structs.replace(p, default=drawn) for p in whole.parameters)
    )
    node = graph(unknown).node("asset:uav")
    assert (node.title, node.count) == ("uav[1..uavs]", 0)


def test_relations_name_the_channel_grid_or_asset_that_they_use(whole: m.Mission) -> None:
    edges = {edge.kind: edge for edge in graph(whole).edges}
    assert (edges["information_handoff"].label, edges["information_handoff"].via) == ("carries", "channel:detection")
    assert (edges["cooperation"].via, edges["cooperation"].mutual) == ("grid:cells", True)
    assert edges["competition"].via == "asset:boat"
    assert edges["guidance"].via == "channel:assignment"
    assert edges["dependency"].label == "per v"


def test_the_hidden_target_is_reachable_from_success_in_the_graph(whole: m.Mission) -> None:
    shown = graph(whole)
    reached, waiting = set(), ["outcome:success"]
    while waiting:
        node = waiting.pop()
        if node not in reached:
            reached.add(node)
            waiting += [edge.target for edge in shown.out_of(node, "requires", "adjudicates", "hides")]
    assert {"rule:rescued", "event:rescue", "rule:matched", "channel:detection", "fact:victim.position"} <= reached
    assert [e.source for e in shown.edges if (e.kind, e.target) == ("unlocks", "event:rescue")] == ["rule:reported"]


# -- everything a mission may declare


@pytest.fixture(scope="module")
def everything(whole: m.Mission) -> m.Mission:
    """The sea rescue with one of each declaration that it lacks."""
    boat, uav = ex.Ref("boat", "entity"), ex.Ref("uav", "group")
    victim_i = ex.Index(ex.Ref("victim", "group"), ex.Number(1.0))
    photos = m.Counted(kind="command", resource=uav, name="takePhoto")
    return msgspec.structs.replace(
        whole,
        budget=msgspec.structs.replace(whole.budget, tokens=ex.Number(1e6, "token"), money=ex.Number(5.0, "USD")),
        agents=tuple(
            msgspec.structs.replace(a, budget=m.AllowanceDeclaration(messages=ex.Number(40.0))) for a in whole.agents
        ),
        reveals=(m.Reveal(what="image", entity=ex.Ref("victim", "group"), role="searcher"),),
        limits=(
            m.Limit(name="photos", most=ex.Number(30.0), counts=(photos,)),
            m.Limit(name="talk", most=ex.Number(9.0), counts=(m.Counted(kind="message", name="progress"),), when=STAR),
        ),
        stages=(
            msgspec.structs.replace(
                whole.stages[0],
                ticks=ex.Number(40.0, "tick"),
                weight=ex.Number(2.0),
                limits=(m.Limit(name="looks", most=ex.Number(8.0), counts=(photos,)),),
            ),
            *whole.stages[1:],
        ),
        permits=(m.Permit(resource=boat, verb="moveTo", condition=exists("reported")),),
        constraints=(
            m.Constraint(
                name="fence",
                kind="hard",
                variable="u",
                domain="uav",
                condition=ex.Binary("in", ex.Ref("u", "local"), ex.Ref("search", "region")),
            ),
            m.Constraint(name="thrift", kind="soft", condition=ex.Flag(True), penalty=ex.Number(0.1)),
        ),
        inspections=(
            m.Inspection(name="looked", asset=boat, by=(uav,), within=ex.Number(25.0, "m"), replan="progress"),
        ),
        events=(
            m.EventDeclaration(
                name="rescue",
                at=ex.Number(12.0, "tick"),
                changes=(
                    m.Change(kind="weather", weather=(m.Property(name="wind_mps", value=ex.Number(12.0, "m/s")),)),
                    m.Change(kind="appear", entity=victim_i),
                ),
            ),
        ),
        failure=ex.Call("inspected", (ex.Symbol("looked"),)),
    )


def exists(rule: str) -> ex.Quantified:
    return ex.Quantified("exists", "r", "detection", ex.Call(rule, (V, R), rule=True))


def test_a_mission_with_every_declaration_has_every_kind_of_node_and_edge(everything: m.Mission) -> None:
    shown = graph(everything)
    assert {node.kind for node in shown.nodes} == set(get_args(NodeKind))
    assert {edge.kind for edge in shown.edges} == set(get_args(EdgeKind))


@pytest.mark.parametrize(
    "edge",
    [
        "reveals target:victim role:searcher",
        "requires outcome:success resource:budget.tokens",
        "requires outcome:success resource:budget.money",
        "requires agent:scout resource:scout.budget.messages",
        "requires asset:uav resource:photos",
        "requires channel:progress resource:talk",
        "requires stage:detect resource:detect.looks",
        "unlocks rule:reported asset:boat",
        "adjudicates constraint:fence asset:uav",
        "requires constraint:fence region:search",
        "requires outcome:success constraint:fence",
        "adjudicates inspection:looked asset:boat",
        "requires inspection:looked asset:uav",
        "requires inspection:looked channel:progress",
        "requires outcome:failure inspection:looked",
        "changes event:rescue@ target:victim",
    ],
)
def test_each_declaration_adds_its_edge(everything: m.Mission, edge: str) -> None:
    assert edge in {each.id for each in graph(everything).edges}


def test_node_details_state_limits_weights_and_penalties(everything: m.Mission) -> None:
    shown = graph(everything)
    assert shown.node("stage:detect").detail == "per victim, ≤ 40 ticks, weight 2"
    assert shown.node("resource:photos").detail == "≤ 30 uav.takePhoto"
    assert shown.node("resource:talk").modes == ("star",)
    assert shown.node("constraint:thrift").detail == "soft, penalty 0.1"
    assert shown.node("event:rescue@").text == "wind_mps = 12 m/s"
    assert "requires outcome:success constraint:thrift" not in {edge.id for edge in shown.edges}


def test_the_graph_of_an_empty_mission_is_success_and_the_budget(whole: m.Mission) -> None:
    bare = msgspec.structs.replace(
        whole, regions=(), grids=(), groups=(), agents=(), authorities=(), messages=(), rules=(), unlocks=(),
        stages=(), relations=(), comms=m.Comms(), success=ex.Flag(True),
    )  # fmt: skip
    nodes, edges = ids(graph(bare))
    assert nodes == {"outcome:success", "resource:budget.ticks"}
    assert edges == {"requires outcome:success resource:budget.ticks"}


# -- guards


def test_a_guard_over_parameters_is_kept_as_text() -> None:
    many = ex.Binary(">", ex.Ref("uavs", "param"), ex.Number(1.0))
    modes = ("star", "broadcast")
    present = presence(m.Guard(condition=many), modes)
    assert present is not None
    assert (present.when, present.modes) == ("uavs > 1", modes)
    both = presence(m.Guard(condition=ex.Binary("and", STAR.condition, many)), modes)
    assert both is not None
    assert (both.when, both.modes) == ("mode == star and uavs > 1", ("star",))
    alone = presence(m.Guard(condition=ex.Binary("or", STAR.condition, many)), ("star",))
    assert alone is not None
    assert (alone.when, alone.modes) == ("", ("star",))


def test_a_guard_that_never_holds_removes_the_declaration() -> None:
    assert presence(m.Guard(condition=ex.Unary("not", STAR.condition)), ("star",)) is None
    assert presence(m.Guard(condition=ex.Flag(False)), ("star", "broadcast")) is None


def test_an_edge_to_a_guarded_declaration_exists_only_in_the_same_modes(whole: m.Mission) -> None:
    guarded = msgspec.structs.replace(
        whole,
        messages=tuple(msgspec.structs.replace(k, when=STAR) if k.name == "assignment" else k for k in whole.messages),
    )
    modes = {edge.id: edge.modes for edge in graph(guarded).edges}
    assert modes["requires stage:handoff channel:assignment"] == ("star",)
    assert "channel:assignment" not in ids(graph(guarded, "broadcast"))[0]


# -- mistakes


def test_an_unknown_mode_is_refused_with_the_list_of_known_modes(whole: m.Mission) -> None:
    with pytest.raises(UsageError, match="no mode `mesh`") as caught:
        graph(whole, "mesh")
    assert "star, broadcast" in caught.value.hint


def test_a_relation_to_an_unknown_role_is_an_error_that_names_the_role(whole: m.Mission) -> None:
    wrong = m.Relation(kind="guidance", source="nobody", target="searcher")
    with pytest.raises(MissionError, match="guidance names `nobody`"):
        graph(msgspec.structs.replace(whole, relations=(wrong,)))


# -- spelling


@pytest.mark.parametrize(
    ("expr", "text"),
    [
        (ex.Number(0.5, "ms"), "500 ms"),
        (ex.Number(2100.0, "min"), "35 min"),
        (ex.Number(0.2, "%"), "20 %"),
        (ex.Number(-3.5, "m"), "-3.5 m"),
        (ex.Binary("*", ex.Binary("+", ex.Number(1.0), ex.Number(2.0)), ex.Number(3.0)), "(1 + 2) * 3"),
        (ex.Binary("-", ex.Number(1.0), ex.Binary("-", ex.Number(2.0), ex.Number(3.0))), "1 - (2 - 3)"),
        (ex.Unary("not", ex.Binary("or", ex.Flag(True), ex.Flag(False))), "not (true or false)"),
        (ex.Index(ex.Ref("uav", "group"), ex.Ref("i", "local")), "uav[i]"),
        (ex.Draw("sites", (ex.Ref("sea", "region"),), (("apart", ex.Number(80.0, "m")),)), "sites(sea, apart ≥ 80 m)"),
        (ex.Draw("normal", (ex.Number(1.0), ex.Number(2.0)), (("high", ex.Number(3.0)),)), "normal(1, 2, high ≤ 3)"),
        (ex.Binary("in", ex.Ref("now", "clock"), ex.Range(ex.Number(1.0), ex.Number(2.0))), "now in 1..2"),
        (ex.Sequence((ex.Text("a"), ex.Range(ex.Number(1.0), ex.Number(2.0)))), '["a", 1..2]'),
        (ex.Aggregate("sum", "o", "order", ex.Attr(ex.Ref("o", "local"), "demand")), "sum(o.demand for o in order)"),
        (exists("matched"), "exists r: matched(v, r)"),
    ],
)  # fmt: skip
def test_expressions_are_written_in_the_syntax_of_the_language(expr: ex.Expr, text: str) -> None:
    assert spell(expr) == text
