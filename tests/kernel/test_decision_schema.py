"""The JSON Schema for foreign programs and the kernel's admission agree on every decision."""

import msgspec
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from lingjing.kernel.bus import MessageRouter
from lingjing.kernel.commands import CommandValidator
from lingjing.kernel.registry import Registry
from lingjing.mission.instance import ArgumentSpec, MessageSpec, VerbSpec
from lingjing.plugins.decisions import MESSAGES_PER_CALL, REACH_M, DecisionFormat
from lingjing.testing import brief_of
from lingjing.testing import rescue as kit
from lingjing.testing.declarations import Field
from lingjing.trace.records import BodyState, Decision

FRAME = "f1-uav[1]-nadir"
"""The only picture taken so far. Only the running episode knows the pictures."""

NAMES = ("x", "y", "camera", "class")
NUMBERS = st.one_of(
    st.integers(-60, 60), st.floats(-1.5, 1.5), st.sampled_from([REACH_M, -REACH_M, 1.1 * REACH_M, 1e300, 0.0, 1.0])
)
TEXTS = st.sampled_from([FRAME, "nadir", "", "person"])
SCALARS = st.one_of(NUMBERS, TEXTS, st.booleans(), st.none())
LISTS = st.one_of(
    st.lists(st.floats(-0.2, 1.2), max_size=5), st.lists(SCALARS, max_size=4), st.just([0.1, 0.2, 0.3, 0.4])
)
BOUND = st.one_of(st.none(), st.sampled_from([-1.0, 0.0, 0.5, 40.0]))


@st.composite
def argument_specs(draw, name):
    return ArgumentSpec(
        name=name,
        unit=draw(st.sampled_from(["m", "", "name"])),
        minimum=draw(BOUND),
        maximum=draw(BOUND),
        default=draw(st.sampled_from([None, None, 3.0])),
        optional=draw(st.booleans()),
    )


@st.composite
def fields(draw, name):
    kind = draw(st.sampled_from(["name", "text", "number", "flag", "position", "box", "frame", "names"]))
    bounded = {"minimum": draw(BOUND), "maximum": draw(BOUND)} if kind == "number" else {}
    return Field(name=name, type=kind, optional=draw(st.booleans()), **bounded)


def some(make):
    return st.lists(st.sampled_from(NAMES), max_size=3, unique=True).flatmap(lambda names: st.tuples(*map(make, names)))


VERBS = st.builds(VerbSpec, name=st.sampled_from(["go", "stop", "takePhoto"]), arguments=some(argument_specs))
ROLES = st.lists(st.sampled_from(["searcher", "coordinator", "rescuer", "all"]), max_size=3, unique=True).map(tuple)
MESSAGES = st.builds(
    MessageSpec,
    kind=st.sampled_from(["detection", "order"]),
    type=st.just("note"),
    category=st.sampled_from(["report", "assignment", "other"]),
    fields=some(fields),
    senders=ROLES,
    recipients=ROLES,
)


@st.composite
def instances(draw):
    base = kit.instance(draw(st.sampled_from(["star", "broadcast"])))
    entities = []
    for entity in base.entities:
        verbs = tuple(draw(st.lists(VERBS, max_size=3, unique_by=lambda verb: verb.name)))
        cameras = (kit.CAMERA,) if draw(st.booleans()) else ()
        entities.append(msgspec.structs.replace(entity, verbs=verbs, cameras=cameras))
    messages = tuple(draw(st.lists(MESSAGES, max_size=2, unique_by=lambda message: message.kind)))
    agents = base.agents[: draw(st.integers(1, len(base.agents)))]
    comms = msgspec.structs.replace(base.comms, payload_bytes=10**6)
    return msgspec.structs.replace(base, entities=tuple(entities), messages=messages, agents=agents, comms=comms)


def value_for(kind):
    """Draw mostly a valid value of a field of that kind, sometimes any value."""
    good = {
        "number": NUMBERS,
        "flag": st.booleans(),
        "position": st.lists(NUMBERS, min_size=2, max_size=3),
        "box": st.lists(st.floats(0.0, 1.0), min_size=4, max_size=4).map(sorted),
        "names": st.lists(TEXTS, max_size=2),
        "frame": st.just(FRAME),
    }.get(kind, TEXTS)
    return st.one_of(good, good, good, SCALARS, LISTS) if kind != "frame" else st.one_of(good, NUMBERS, st.none())


@st.composite
def contents(draw, specs, kind_of):
    """Draw values under the names of the specs, mostly all of them, sometimes with an unknown name."""
    values = {spec.name: draw(value_for(kind_of(spec))) for spec in specs if draw(st.integers(0, 7))}
    return {**values, "stray": 1} if not draw(st.integers(0, 9)) else values


@st.composite
def answers(draw, instance, agent):
    mine = [entity for entity in instance.entities if entity.id in agent.commands]
    answer = {"thought": "", "command": None, "messages": []}
    if draw(st.booleans()):
        entity = draw(st.sampled_from(mine or list(instance.entities)))
        verb = draw(st.sampled_from(entity.verbs or (VerbSpec(name="fly"),)))
        kinds = contents(verb.arguments, lambda spec: "name" if spec.unit == "name" else "number")
        answer["command"] = {
            "verb": draw(st.sampled_from([verb.name] * 5 + ["fly"])),
            "arguments": draw(kinds),
            "resource": draw(st.sampled_from([entity.id] * 4 + [None, "submarine", "uav[2]", ""])),
        }
    if instance.messages and draw(st.booleans()):
        spec = draw(st.sampled_from(instance.messages))
        message = {
            "kind": draw(st.sampled_from([spec.kind] * 5 + ["gossip"])),
            "body": draw(contents(spec.fields, lambda field: field.type)),
            "to": draw(st.lists(st.sampled_from(["scout[1]", "scout[2]", "skipper", "nobody"]), max_size=2)),
        }
        answer["messages"] = [message] * draw(st.sampled_from([1, 1, 1, 2, MESSAGES_PER_CALL + 1]))
    return answer


def admits(instance, agent, decision):
    """Return whether the kernel admits all of a decision, without pending requests and counted budgets."""
    states = {
        entity.id: BodyState(id=entity.id, position=entity.position, status="idle") for entity in instance.entities
    }
    resolution = CommandValidator(instance).resolve([(agent.id, decision.command)], Registry(states=states), 1)
    _, receipts = MessageRouter(instance).expand([(agent.id, decision.messages)], 1, {FRAME})
    return all(receipt.status != "rejected" for receipt in (*resolution.receipts, *receipts))


@given(st.data())
@settings(max_examples=100, deadline=None)
def test_the_schema_accepts_what_the_kernel_admits_and_nothing_else(data):
    instance = data.draw(instances())
    agent = data.draw(st.sampled_from(instance.agents))
    form = DecisionFormat(brief_of(instance, agent.id, ("person",)))
    answer = form.completed(data.draw(answers(instance, agent)))
    faults = form.faults(answer)
    try:
        decision = msgspec.convert(answer, Decision)
    except msgspec.ValidationError:
        assert faults  # it is no decision at all
        return
    event("refused" if faults else "admitted")
    assert admits(instance, agent, decision) == (not faults), faults


@pytest.mark.parametrize("agent", kit.instance("star").agents, ids=lambda agent: agent.id)
def test_the_schema_conforms_to_draft_2020_12_and_is_deterministic(agent):
    from jsonschema import Draft202012Validator

    brief = brief_of(kit.instance("star"), agent.id, ("person",))
    form = DecisionFormat(brief)
    Draft202012Validator.check_schema(form.schema)
    assert msgspec.json.encode(form.schema) == msgspec.json.encode(DecisionFormat(brief).schema)


def test_all_faults_are_reported_at_once_with_their_paths():
    instance = kit.instance("star")
    form = DecisionFormat(brief_of(instance, instance.agents[0].id, ("person",)))
    answer = {
        "command": {"verb": "go", "arguments": {"x": "far", "w": 1}},
        "messages": [
            {"kind": "order", "body": {"position": [1]}},
            {"kind": "gossip"},
            {"kind": "detection", "body": {"frame": FRAME, "class": "person", "box": [0, 0, 2, 1], "position": [0, 0]}},
            "hello",
        ],
    }
    assert sorted(form.faults(form.completed(answer))) == [
        "command.arguments.x: a number is due, this is the text 'far'",
        "command.arguments: 'y' is missing (add the field)",
        "command.arguments: there is no field 'w'",
        "messages[0].body.position: a list of 2 is due, this one has 1",
        "messages[0].body: 'assignee' is missing (add the field)",
        "messages[1].kind: detection or order is due, this is the text 'gossip'",
        "messages[2].body.box[2]: at most 1 is due, this is 2",
        "messages[2].body: 'confidence' is missing (add the field)",
        "messages[3]: an object is due, this is the text 'hello'",
    ]


@pytest.mark.parametrize(
    ("command", "fault"),
    [
        ({"verb": "dance"}, "command.verb: go, hop, mute, stop or takePhoto is due, this is the text 'dance'"),
        ({"verb": "go", "resource": "tug"}, "command.resource: uav[1] is due, this is the text 'tug'"),
        ({"verb": "takePhoto", "arguments": {"camera": "rear"}}, "command.arguments.camera: nadir is due, this is"),
        ({}, "command.verb: go, hop, mute, stop or takePhoto is due, this is the text ''"),
        (5, "command: an object or null is due, this is the number 5"),
    ],
)
def test_the_fault_of_an_invalid_command_names_the_valid_values(command, fault):
    instance = kit.instance("star")
    form = DecisionFormat(brief_of(instance, instance.agents[0].id, ("person",)))
    (message,) = form.faults(form.completed({"command": command}))
    assert message.startswith(fault)


def test_a_box_with_its_edges_in_the_wrong_order_is_a_fault():
    instance = kit.instance()
    form = DecisionFormat(brief_of(instance, instance.agents[0].id, ("person",)))
    body = {"frame": FRAME, "class": "person", "box": [0.5, 0, 0.5, 1], "position": [0, 0], "confidence": 1}
    (fault,) = form.faults(form.completed({"messages": [{"kind": "detection", "body": body}]}))
    assert fault.startswith("messages[0].body.box: ")
