"""Hidden values stay hidden: two instances that differ only in them give every agent the same inputs.

All engines are the real ones, with their effects of a hidden place: queues and the waiting traffic, fires that burn,
persons adrift. Only the camera draws grey pictures, because a sensor may show a difference. Agents fly, walk, drive,
take pictures, send false reports and messages. Their inputs are compared byte by byte.
"""

from __future__ import annotations

import functools
import math

import msgspec
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lingjing.kernel.cities import CityBuilder
from lingjing.mission.instance import Instance, MessageSpec
from lingjing.plugins.policy import Inbox, Observation
from lingjing.testing import CENTRE_BOX, Episode, PluginHost, Stage, does, instantiate, reports
from lingjing.trace.records import Action, Decision, Outgoing
from tests.missions import staging as kit

HIDING = tuple(column for column in kit.COLUMNS if column[0] != "cd")
TICKS = {"vdn": 2, "idf": 2, "ufr": 2, "cr": 3, "ld": 3}
ENGINES = ("city", "multirotor", "quadruped", "vessel", "road")

columns = pytest.mark.parametrize(("name", "mode"), [pytest.param(*column, id="-".join(column)) for column in HIDING])
host = functools.cache(PluginHost)


def drawn(name: str, mode: str, seed: int) -> Instance:
    """An instance before it is put on its city."""
    return instantiate(kit.mission(name), seed=seed, mode=mode)


def otherwise(instance: Instance, other: Instance) -> Instance:
    """`instance` with every hidden value as it is in `other`, and nothing else."""
    theirs = {entity.id: entity for entity in other.entities}

    def swapped(entity):
        new = theirs[entity.id]
        place = new.position if "position" in entity.hidden else entity.position
        values = {key: new.properties[key] for key in entity.hidden if key in new.properties}
        return msgspec.structs.replace(entity, position=place, properties={**entity.properties, **values})

    return msgspec.structs.replace(instance, entities=tuple(map(swapped, instance.entities)))


@functools.cache
def pair(name: str, mode: str) -> tuple[Instance, Instance]:
    """Two instances on their city that differ in hidden values only. Every hidden entity is somewhere else."""
    first = drawn(name, mode, 0)
    for seed in range(1, 50):
        second = otherwise(first, drawn(name, mode, seed))
        moved = [a.position != b.position for a, b in zip(first.entities, second.entities, strict=True) if a.hidden]
        if all(moved):
            break
    assert moved and all(moved)
    cities = CityBuilder(host())
    return cities.place(first)[0], cities.place(second)[0]


def filler(spec: MessageSpec, frame: str | None) -> dict[str, object] | None:
    """A body with a value for every field, or None if a field needs a picture and there is none."""
    made: dict[str, object] = {}
    for item in spec.fields:
        if item.type == "frame" and frame is None:
            return None
        low = item.minimum.value if hasattr(item.minimum, "value") else item.minimum
        made[item.name] = {
            "frame": frame,
            "number": low if low is not None else 1.0,
            "box": CENTRE_BOX,
            "position": (10.0, 20.0),
            "names": ("a", "b"),
            "flag": True,
        }.get(item.type, "word")
    return made


MOTION = {"takeoff": {}, "forward": {"distance": 5.0}, "moveTo": {"x": 0.0, "y": -1200.0}, "setDestination": None}


def busy(play: Episode) -> dict[str, Decision]:
    """The decisions of all agents at this boundary: commands in turn, a picture, every allowed message.

    No agent requests another route, because the answer may depend on hidden values.
    """
    tick = play.published.record.tick
    replans = {inspection.replan for inspection in play.instance.inspections}
    out = {}
    for agent in play.instance.agents:
        own = play.published.observations[agent.id].pictures
        frame = next((picture.frame for picture in own if picture.camera != "reference"), None)
        messages = []
        for spec in play.instance.messages:
            if spec.kind in replans or ("all" not in spec.senders and agent.role not in spec.senders):
                continue
            body = filler(spec, frame)
            if body is not None:
                messages.append(Outgoing(kind=spec.kind, body=body))
        out[agent.id] = Decision(command=motion(play, agent.controls, tick), messages=tuple(messages))
    return out


def motion(play: Episode, controls: tuple[str, ...], tick: int) -> Action | None:
    if not controls:
        return None
    entity = play.entity(controls[0])
    verbs = [verb.name for verb in entity.verbs]
    if tick % 2 and "takePhoto" in verbs:
        return Action(verb="takePhoto", arguments={})
    chosen = next((verb for verb in MOTION if verb in verbs), None)
    if chosen is None:
        return None
    arguments = MOTION[chosen]
    if arguments is None:
        x, y, _ = entity.position
        arguments = {"x": x + 60.0, "y": y}
    return Action(verb=chosen, arguments=arguments)


def input_bytes(observation: Observation, inbox: Inbox) -> bytes:
    """One agent's whole input as bytes, pixels included."""
    pictures = tuple(
        (p.frame, p.entity, p.camera, p.tick, p.time_s, p.pose, p.rgb.tobytes()) for p in observation.pictures
    )
    truth = observation.privileged and (observation.privileged.instance, observation.privileged.states)
    parts = (observation.agent, observation.tick, observation.time_s, observation.entities, observation.cells)
    seen = (*parts, observation.events, pictures, observation.absent, truth)
    return msgspec.msgpack.encode((seen, inbox.messages, inbox.receipts))


def inputs(name: str, mode: str, instance: Instance, privileged: frozenset[str] = frozenset()):
    """Return everything that agents receive in an episode of some ticks: briefs, inputs, their digests."""
    with kit.playing(name, mode, real=ENGINES, instance=instance, privileged=privileged) as play:
        for _ in range(TICKS.get(name, 4)):
            play.do(busy(play))
        briefs = {agent: msgspec.msgpack.encode(brief) for agent, brief in play.kernel.briefs().items()}
        rows = [
            {
                agent: input_bytes(boundary.observations[agent], boundary.inboxes[agent])
                for agent in boundary.observations
            }
            for boundary in play.all
        ]
        digests = [{seen.agent: seen.sha256 for seen in boundary.record.observations} for boundary in play.all]
        truth = [{state.id: state.position for state in boundary.record.snapshots[-1].states} for boundary in play.all]
        moved = {r.status for r in play.receipts if not r.request.startswith("k")}
    return briefs, rows, digests, truth, moved


@functools.cache
def both_inputs(name: str, mode: str):
    first, second = pair(name, mode)
    return inputs(name, mode, first), inputs(name, mode, second)


@columns
def test_anchoring_places_public_entities_independently_of_hidden_ones(name, mode):
    """Public entities are moved away from other public ones, but not from hidden ones."""
    first, second = pair(name, mode)
    for entity, other in zip(first.entities, second.entities, strict=True):
        assert entity == other or entity.hidden, entity.id
    assert first.regions == second.regions


@columns
def test_public_entities_are_not_moved_away_from_hidden_ones(name, mode):
    """Not even if a hidden entity stands at the place of a public one."""
    plain = drawn(name, mode, 0)
    cities = CityBuilder(host())
    before, _ = cities.place(plain)
    public = [entity for entity in before.entities if not entity.hidden]
    for crowded in public:
        entities = tuple(
            msgspec.structs.replace(entity, position=crowded.position) if entity.hidden else entity
            for entity in plain.entities
        )
        after, _ = cities.place(msgspec.structs.replace(plain, entities=entities))
        assert [entity for entity in after.entities if not entity.hidden] == public


@columns
def test_briefs_do_not_depend_on_hidden_values(name, mode):
    first, second = both_inputs(name, mode)
    assert first[0] == second[0]


@columns
def test_inputs_of_agents_do_not_depend_on_hidden_values(name, mode):
    first, second = both_inputs(name, mode)
    for tick, (row, other) in enumerate(zip(first[1], second[1], strict=True)):
        assert row == other, tick
    assert "accepted" in first[4], "the agents did something"


@columns
def test_digests_of_inputs_do_not_depend_on_hidden_values(name, mode):
    first, second = both_inputs(name, mode)
    assert first[2] == second[2]


@columns
def test_only_the_agent_of_a_privileged_policy_receives_the_truth(name, mode):
    """In an episode with one oracle, this agent receives the true places; nothing changes for the others."""
    first, second = pair(name, mode)
    oracle = first.agents[0].id
    seen, other = (first_boundary(name, mode, each, frozenset({oracle})) for each in (first, second))
    blind = both_inputs(name, mode)[0][1][0]
    assert seen[oracle] != other[oracle]
    for agent in seen:
        if agent != oracle:
            assert seen[agent] == other[agent] == blind[agent]


@columns
def test_without_a_privileged_policy_no_agent_receives_the_truth(name, mode):
    with kit.playing(name, mode, instance=pair(name, mode)[0]) as play:
        assert all(seen.privileged is None for seen in play.published.observations.values())


def first_boundary(name, mode, instance, privileged):
    with kit.playing(name, mode, real=ENGINES, instance=instance, privileged=privileged) as play:
        return {
            agent: input_bytes(seen, play.published.inboxes[agent])
            for agent, seen in play.published.observations.items()
        }


@columns
def test_hidden_entities_have_different_places_in_the_two_worlds(name, mode):
    """Otherwise the tests above would check nothing: every hidden target really stands somewhere else."""
    first, second = both_inputs(name, mode)
    hidden = [entity.id for entity in pair(name, mode)[0].entities if entity.hidden]
    for places, other in zip(first[3], second[3], strict=True):
        assert all(places[entity] != other[entity] for entity in hidden)


def test_a_city_delivery_has_no_hidden_values():
    """The only mission without hidden values: its planner receives every point and its demand."""
    for mode in ("star", "broadcast"):
        instance = drawn("cd", mode, 0)
        assert not any(entity.hidden for entity in instance.entities) and not instance.reveals


def test_agents_cannot_distinguish_a_true_report_from_a_false_report():
    """The same report is true in one world and false in the other; the trace records this, and no agent receives it."""
    first, second = (kit.still(each) for each in pair("ufr", "broadcast"))
    place = next(entity for entity in first.entities if entity.id == "fire[1]").position[:2]
    seen = []
    for instance in (first, second):
        with kit.playing("ufr", "broadcast", instance=instance) as play:
            play.stage.boxes = {"fire[1]": CENTRE_BOX}
            play.do({"scout[1]": does("takePhoto", camera="nadir")})
            play.do({"scout[1]": reports("detection", "f1-uav[1]-nadir", "building_fire", place)})
            play.stage.boxes = {}
            play.do()
            seen.append(
                [
                    {
                        name: input_bytes(boundary.observations[name], boundary.inboxes[name])
                        for name in boundary.observations
                    }
                    for boundary in play.all
                ]
            )
            kinds = [event.kind for event in play.events]
            assert kinds == (["matched", "located"] if instance is first else ["matched"])
    assert seen[0] == seen[1]


@columns
@settings(max_examples=3, deadline=None, derandomize=True, database=None)
@given(seed=st.integers(1, 10_000), east=st.floats(-300.0, 300.0), north=st.floats(-300.0, 300.0))
def test_inputs_do_not_depend_on_the_places_of_hidden_entities(name, mode, seed, east, north):
    """Any other draw, with all hidden entities anywhere else in the scene: without a sensor, no agent can detect it.

    The actors stand still here, away from the dogs' fires and other targets that are touched before they are seen.
    """
    first = pair(name, mode)[0]
    other = otherwise(first, drawn(name, mode, seed))
    shifted = tuple(
        msgspec.structs.replace(
            entity, position=(entity.position[0] + east, entity.position[1] + north, entity.position[2])
        )
        if "position" in entity.hidden
        else entity
        for entity in other.entities
    )
    actors = [entity.position for entity in first.entities if entity.role == "asset"]
    near = [e for e in shifted if "position" in e.hidden and any(math.dist(e.position, a) < 60.0 for a in actors)]
    assume(not near)
    goal = next((entity.position for entity in first.entities if entity.type == "destination"), (0.0, 0.0, 0.0))
    seen = []
    for instance in (first, msgspec.structs.replace(other, entities=shifted)):
        with kit.playing(name, mode, instance=instance, stage=Stage(routes=[(goal,)])) as play:
            for _ in range(3):
                play.do(busy(play))
            briefs = {agent: msgspec.msgpack.encode(brief) for agent, brief in play.kernel.briefs().items()}
            rows = [
                {agent: input_bytes(boundary.observations[agent], boundary.inboxes[agent]) for agent in briefs}
                for boundary in play.all
            ]
            digests = [[seen.sha256 for seen in boundary.record.observations] for boundary in play.all]
        seen.append((briefs, rows, digests))
    assert seen[0] == seen[1]


@pytest.mark.parametrize(("name", "mode"), [("cr", "star"), ("ld", "star")])
def test_no_event_reveals_a_jam_to_the_agent_of_the_uav_above_the_jam(name, mode):
    """The engine records the congestion in the trace alone. The agent detects it only in pictures."""
    first, second = pair(name, mode)
    jams = [entity.id for entity in first.entities if entity.type == "congestion"]
    elsewhere = msgspec.structs.replace(
        first,
        entities=tuple(
            msgspec.structs.replace(entity, position=(-400.0, -400.0, entity.position[2]))
            if entity.id in jams
            else entity
            for entity in second.entities
        ),
    )
    seen, emitted = [], []
    for instance in (first, elsewhere):
        stage = Stage(routes=[((300.0, 0.0, 0.0),)])
        with kit.playing(name, mode, instance=instance, stage=stage) as play:
            play.stage.places["uav"] = (*next(e.position for e in first.entities if e.id == jams[0])[:2], 60.0)
            play.wait(3)
            emitted.append({event for event in play.emitted() if event.startswith("record ")})
            seen.append(
                [
                    {
                        name: input_bytes(boundary.observations[name], boundary.inboxes[name])
                        for name in boundary.observations
                    }
                    for boundary in play.all
                ]
            )
    assert emitted == [{f"record {jams[0]}"}, set()]
    assert seen[0] == seen[1]
