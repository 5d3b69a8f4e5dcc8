"""The visibility of events: actions are visible; verdicts on reports and hidden entities nearby are not."""

from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing.kernel.event_visibility import EventVisibility
from lingjing.kernel.visibility import Projector
from lingjing.mission.instance import ChannelSpec, Instance, InteractionSpec
from lingjing.testing import CENTRE_BOX, compile_text, does, instantiate, mission_file
from lingjing.testing import rescue as kit
from lingjing.testing.declarations import Constraint
from lingjing.testing.expressions import Binary, Call, Number, Point, Quantified, Ref, Symbol
from lingjing.trace.records import AdjudicatedEvent, Receipt, TaskEvent

RESCUE = TaskEvent(kind="rescue", entities=("victim[1]", "boat"), time_s=10.0)
PAST = Binary(
    "<=", Call("distance_xy", (Ref("boat", "entity"), Point((Number(0.0), Number(-60.0))))), Number(1.0)
)  # fmt: skip


def instance(audience=None, **changes):
    made = kit.instance("star", **changes)
    rescue = InteractionSpec(name="rescue", by="glider", within_m=50.0, told=audience or "")
    entities = tuple(
        msgspec.structs.replace(entity, interactions=(rescue,)) if entity.role == "target" else entity
        for entity in made.entities
    )
    agents = tuple(
        msgspec.structs.replace(agent, observes=(*agent.observes, ChannelSpec(source="events")))
        for agent in made.agents
    )
    return msgspec.structs.replace(made, entities=entities, agents=agents)


def visible_views(of, task_events=(), judged=()):
    """Return the visible events by agent."""
    announcements = EventVisibility(of)
    return {agent.id: announcements.visible_events(agent, task_events, judged, 4) for agent in of.agents}


def observers(views):
    return {agent for agent, seen in views.items() if seen}


ALL_AGENTS = {"scout[1]", "scout[2]", "skipper", "commander"}


@pytest.mark.parametrize(
    ("word", "agents"), [("all", ALL_AGENTS), ("actor", {"skipper"}), ("none", set()), (None, set())]
)
def test_an_interaction_with_a_hidden_entity_is_visible_as_its_type_declares(word, agents):
    views = visible_views(instance(word), (RESCUE,))
    assert observers(views) == agents
    assert all(view.entities == ("boat",) for seen in views.values() for view in seen), "the victim is not named"


def test_an_interaction_with_a_public_entity_is_visible_to_all_agents():
    plain = instance()
    plain = msgspec.structs.replace(
        plain, entities=tuple(msgspec.structs.replace(entity, hidden=()) for entity in plain.entities)
    )
    views = visible_views(plain, (RESCUE,))
    assert observers(views) == ALL_AGENTS
    assert views["skipper"][0].entities == ("victim[1]", "boat")


def test_a_collision_with_a_hidden_entity_is_visible_only_to_the_agent_of_the_other_body():
    assert observers(
        visible_views(instance(), (TaskEvent(kind="collided", entities=("uav[2]", "victim[1]"), time_s=1.0),))
    ) == {"scout[2]"}
    assert (
        observers(visible_views(instance(), (TaskEvent(kind="arrived", entities=("uav[2]",), time_s=1.0),)))
        == ALL_AGENTS
    )


def test_a_receipt_of_an_engine_names_no_hidden_entity():
    """A receipt of the kernel repeats the agent's own words, which do not confirm that a hidden entity exists."""
    projector = Projector(instance())
    hit = Receipt(request="c1", tick=3, sender="scout[2]", resource="uav[2]", status="rejected", by="glider",
                  detail="`uav[2]` hit `victim[1]` over `boat`")  # fmt: skip
    assert projector.redacted(hit).detail == "`uav[2]` hit something over `boat`"
    rejection = msgspec.structs.replace(hit, by="kernel", detail="there is no resource `victim[1]`")
    assert projector.redacted(rejection) is rejection
    plain = msgspec.structs.replace(hit, detail="`uav[2]` hit `house-3`")
    assert projector.redacted(plain) is plain


def test_event_ids_do_not_count_invisible_events():
    """A gap in the ids would reveal an invisible event."""
    arrived = TaskEvent(kind="arrived", entities=("boat",), time_s=10.0)
    rules = (*kit.instance().rules, kit.rule("met", PAST))
    quiet, busy = (
        visible_views(instance("none", rules=rules), events, verdicts)
        for events, verdicts in (
            ((arrived,), (judged("met", 1),)),
            ((RESCUE, arrived, RESCUE), (judged("matched", 1), judged("met", 2))),
        )
    )
    assert [view.id for view in quiet["skipper"]] == ["t4-1", "e3-1"]
    assert quiet == busy


def judged(kind, number, *bindings):
    return AdjudicatedEvent(id=f"e3-{number}", kind=kind, tick=3, time_s=30.0, bindings=bindings)


@pytest.mark.parametrize(
    ("rule", "is_visible"),
    [
        (kit.rule("known", PAST), True),
        (kit.rule("known", PAST, ("c", "uav")), True),
        (kit.rule("known", kit.NEAR, ("v", "victim")), False),
        (kit.rule("known", PAST, ("r", "detection")), False),
        (kit.rule("known", Quantified("exists", "v", "victim", kit.NEAR)), False),
        (kit.rule("known", Quantified("exists", "r", "detection", PAST)), False),
        (kit.rule("known", kit.both(PAST, kit.called("rescued", "v"))), False),
        (kit.rule("known", Call("emitted", (Symbol("rescue"),))), False),
        (kit.rule("known", Call("clear", (Symbol("check"),))), False),
        (
            kit.rule("known", kit.both(PAST, Call("distance_xy", (Ref("victim", "group"), Ref("boat", "entity"))))),
            False,
        ),
    ],
)
def test_an_event_is_visible_if_its_rule_reads_no_hidden_value_and_no_message(rule, is_visible):
    made = instance(rules=(*kit.instance().rules, rule))
    assert observers(visible_views(made, judged=(judged("known", 1),))) == (ALL_AGENTS if is_visible else set())


@pytest.mark.parametrize(("condition", "domain", "is_visible"), [(PAST, None, True), (kit.NEAR, "victim", False)])
def test_a_broken_constraint_is_visible_under_the_same_conditions(condition, domain, is_visible):
    keep = Constraint(name="keep", kind="soft", condition=condition, variable="v", domain=domain, penalty=Number(0.1))
    views = visible_views(instance(constraints=(keep,)), judged=(judged("keep", 1),))
    assert observers(views) == (ALL_AGENTS if is_visible else set())


def test_agents_cannot_distinguish_a_correct_report_from_a_wrong_one():
    """The same picture is reported correctly and wrongly. Until a body acts, no agent can distinguish the two."""
    inputs = []
    for box in (CENTRE_BOX, (0.0, 0.0, 0.1, 0.1)):
        kernel = kit.kernel(instance("all"))
        kernel.reset()
        kernel.step(kit.decisions(scout_1=does("takePhoto")))
        judged_now = kernel.step(kit.decisions(scout_1=kit.report("f1-uav[1]-nadir", box=box)))
        later = kernel.step(kit.decisions())
        inputs.append(([event.kind for event in judged_now.record.events], later.observations, later.inboxes))
    right, wrong = inputs
    assert (right[0], wrong[0]) == (["matched", "reported"], [])
    assert right[1] == wrong[1]


YARD = (Path(__file__).parent / "data" / "locker.ljs").read_text()


def locker(unlock: str, audience: str = "") -> tuple[Instance, EventVisibility]:
    """Return an instance with a public locker, and its filter. `unlock` is the condition of opening it."""
    text = YARD.replace("CONDITION", unlock).replace("within = 9 m", f"within = 9 m{audience}")
    compilation = compile_text(text)
    assert compilation.mission is not None, compilation.diagnostics
    made = instantiate(compilation.mission, seed=1)
    return made, EventVisibility(made)


@pytest.mark.parametrize(
    ("unlock", "audience", "observing", "seen"),
    [
        ("now > 20 s", "", {"scout", "skipper"}, {"scout", "skipper"}),
        ("victim.position.east > 20 m", "", set(), set()),
        ("victim.position.east > 20 m", ", told = all", {"scout", "skipper"}, {"scout", "skipper"}),
        ("victim.position.east > 20 m", ", told = actor", {"skipper"}, {"skipper"}),
    ],
)
def test_an_unlock_that_reads_a_hidden_value_is_visible_only_to_its_declared_audience(
    unlock, audience, observing, seen
):
    made, visibility = locker(unlock, audience)
    opened = TaskEvent(kind="open", entities=("box", "boat"), time_s=30.0)
    views = {agent.id: visibility.visible_events(agent, (opened,), (), 3) for agent in made.agents}
    assert observers(views) == observing
    box = next(entity for entity in made.entities if entity.id == "box")
    assert {agent.id for agent in made.agents if "status" not in visibility.withheld(agent, box)} == seen
    boat = next(entity for entity in made.entities if entity.id == "boat")
    assert not any(visibility.withheld(agent, boat) for agent in made.agents)


@pytest.mark.parametrize("tier", [0, 1])
@pytest.mark.parametrize("name", ["bi", "vdn", "ld", "idf", "upr", "ufr", "cr", "ssr", "cd"])
def test_no_agent_of_a_shipped_mission_observes_whether_a_report_matched(name: str, tier: int) -> None:
    """Prompt P1 promises this for every column."""
    mission = lingjing.compile(mission_file(name))
    for mode in mission.modes.allowed:
        of = instantiate(mission, seed=1, mode=mode, tier=tier)
        kinds = {message.kind for message in of.messages}
        over = [rule for rule in of.rules if any(parameter.domain in kinds for parameter in rule.parameters)]
        views = visible_views(of, judged=tuple(judged(rule.name, 1) for rule in over))
        assert observers(views) == set(), [rule.name for rule in over]
