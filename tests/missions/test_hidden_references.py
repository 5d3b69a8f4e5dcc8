"""Hidden values as indices, lengths of time, amounts and places of agents' bodies: pairs that differ only in them.

The hidden param `k` is 1 or 3, and the hidden place of a body is near or far. The compiler refuses a mission in which
one of them decides something that agents notice. Otherwise blind agents receive equal briefs, observations and inboxes.
With one guard taken out, the same comparison finds a difference.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterator, Mapping
from typing import Any, get_args, get_type_hints

import msgspec
import pytest

from lingjing import Mission
from lingjing.testing import CENTRE_BOX, Stage, brief_of, compile_text, does, episode, reports, says, together
from lingjing.trace.records import Decision

TEXT = """ljs 2
use std.sea {{ lifeboat, person_in_water }}
use std.messages {{ report, status }}
target locker {{
  engine = city
  state water = 10 kg
  interaction open {{ by = vessel, within = 60 m, status = opened }}
}}
{types}mission yard "Yard" {{
  goal "Wait."
  scene bay {{ datum = sea level at -3.5 m }}
  clock {{ tick = 10 s, sync = 1 s }}
  budget {{ ticks <= 100 }}
  mode broadcast
  param hidden k ~ integer({k}, {k})
  region east = box((-25 m, -1400 m), (90 m, -1300 m))
  target box[1..3] : locker {{ position = at(i, [(20 m, -1330 m), (60 m, -1300 m), (300 m, -1300 m)]) }}
  asset boat[1..3] : lifeboat {{ position = at(i, [(10 m, -1350 m), (40 m, -1350 m), (900 m, -1350 m)]) }}
  agent skipper as rescuer controls boat[1] {{ observes boat[1].*, box.*, events{shown} }}
  agent watch as guard {{ observes boat[1].*, box.*, events{shown} }}
  message note : status from rescuer, guard to all
  message detection : report from guard to all
  adjudicate near(b: box) {{ when distance_xy(boat[1], b) < 55 m }}
  {line}
  success when {success}
}}
"""

TYPES = """target store {{
  engine = city
  state oil = 100 kg
  state need = 100 kg
  interaction pump {{ by = mate, within = 60 m, gives = {goods}, from = oil, told = all }}
  interaction serve {{ by = mate, within = 60 m, takes = need, from = {goods}, told = all }}
  interaction fill {{ by = mate, within = 60 m, gives = {goods}, up_to = hold, told = all }}
}}
asset tub : lifeboat {{ engine = vessel, hold = 50 kg, state {goods} = 30 kg }}
"""

SPY = (
    "asset spy : lifeboat {{ hidden position = {place}{equipped} }}\n"
    "  agent mole as mole controls spy {{ observes {seen} }}"
)
CAMERA = ", camera nadir { size = 32 by 32, hfov = 60 deg, channels = [rgb], capture = each_tick }"
STORE = (
    "target tank : store { position = (20 m, -1330 m){tank} }\n  asset tug : tub { position = (10 m, -1340 m){tug} }\n"
    "  agent mate as mate controls tug { observes tug.*, events }\n"
    "  unlock pump(s: tank) when {pump}\n  unlock serve(s: tank) when {serve}\n  unlock fill(s: tank) when {fill}"
)
PLACES = ("(20 m, -1290 m)", "(800 m, -1300 m)")
NEVER = "now > 9000 s"


def spy(rest: str = "", *, equipped: str = "", seen: str = "events") -> str:
    """A body with a hidden place and its agent. `PLACE` is replaced by one of the places."""
    return f"{SPY.format(place='PLACE', equipped=equipped, seen=seen)}\n  {rest}"


def store(*, tank: str = "", tug: str = "", opened: str) -> str:
    """A store and a boat with goods; the interaction `opened` is permitted."""
    text = STORE.replace("{tank}", tank).replace("{tug}", tug)
    for name in ("pump", "serve", "fill"):
        text = text.replace(f"{{{name}}}", "true" if name == opened else NEVER)
    return text


REFUSED: Mapping[str, str] = {
    # a hidden length of time
    "event of a lasting condition": "event e when held(now >= 0 s, k * 10 s) { weather { visibility = 1 km } }",
    "end of an event": "event e at 1 tick until held(now > 0 s, k * 20 s) { weather { visibility = 1 km } }",
    "permit of a lasting condition": "permit boat[1].moveTo when held(now > 0 s, k * 10 s)",
    "permit after a delay": "permit boat[1].moveTo when within(now >= 10 s, now > 20 s, k * 5 s)",
    "constraint of a delay": "constraint hard c { always not within(now >= 0 s, now > 20 s, k * 10 s) }",
    "stage of a lasting condition": "stage s { done when held(now >= 0 s, k * 15 s), deadline = 100 s }",
    "held in a count": "permit boat[1].moveTo when count(held(near(b), k * 10 s) for b in box) >= 1",
    # a hidden index in a condition
    "performed on a member": "permit boat[1].moveTo when not emitted(open, box[k])",
    "count of a member": "permit boat[1].moveTo when count(open, box[k]) < 1",
    "assignment to a member": "permit boat[1].moveTo when now < 15 s or not assigned(boat[1], box[k])",
    "assignment of a member": "permit boat[1].moveTo when now < 15 s or assigned(boat[k], box[1])",
    "life of a member": "event e when alive(boat[k]) and boat[k].position.east > 800 m { weather { cloud = 90 % } }",
    "speed of a member": "permit boat[1].moveTo when now < 15 s or speed(boat[k]) < 1 m/s",
    "rule of a member": "permit boat[1].moveTo when near(box[k])",
    "true box of a member": (
        "permit boat[1].moveTo when exists r in detection: iou(r.box, truth(box[k], r.frame).box) > 0.5"
    ),
    # a hidden index in a declaration
    "body of an agent": "agent mate as mate controls boat[k + 1 - floor(k / 3)] { observes events }",
    "authority": "authority guard may command boat[k]",
    "permitted body": "permit boat[k].moveTo when now > 30 s",
    "counted body": "limit l <= 2 counts boat[k].moveTo",
    "counted body of a stage": "stage s { done when now > 900 s\n limit l <= 2 counts boat[k].moveTo }",
    "picture of a member": "reveal image(box[k]) to guard",
    "motion": "target swan : person_in_water { position = (60 m, -1400 m), "
    "behaviour follow { of = box[k], speed = 2 m/s, distance = 2 m } }",
    "set member": "event e at 2 tick { change box[k].status to opened }",
    "observed member": "agent mate as mate { observes box[k].position }",
    # a body with a hidden place
    "radio range": spy("comms { range <= 100 m }"),
    "jammed area": spy(
        "region bay = circle((20 m, -1290 m), 20 m)\n  event e at 1 tick { jam bay { loss = 100 % } }"
    ),
    "radio range of an event": spy("event e at 1 tick { comms { range <= 100 m } }"),
    "receipts": spy(),
    "receipts by authority": "asset spy : lifeboat { hidden position = PLACE }\n  authority guard may command spy",
    "pose of pictures": spy(equipped=CAMERA + ", actions {}", seen="spy.nadir"),
}  # fmt: skip
"""Declarations that the compiler refuses."""

SILENT: Mapping[str, str] = {
    "rule of a lasting condition": "adjudicate seen() { when held(now > 1 s, k * 5 s) }",
    "rule of a member": "adjudicate seen() { when emitted(open, box[k]) }",
    "rule of a rule": "adjudicate seen() { when near(box[k]) }",
    "unlock of a lasting condition": "unlock open(b: box) when held(now > 1 s, k * 5 s)",
    "unlock of a member": "unlock open(b: box) when near(box[k])",
    "soft constraint": "constraint soft c { always not held(now > 1 s, k * 5 s), penalty = 10 % }",
    "hidden stock": store(tank=", hidden oil = OIL", opened="pump"),
    "hidden demand": store(tank=", hidden need = OIL", opened="serve"),
    "hidden hold": store(tug=", hidden hold = 30 kg + OIL", opened="fill"),
    "body without a command or a radio": spy(equipped=", actions {}"),
}
"""Declarations that agents do not notice."""

AMOUNTS = {name: line for name, line in SILENT.items() if line.startswith("target tank")}
OIL = ("5 kg", "25 kg")

Inputs = list[dict[str, bytes]]


def text(line: str, number: int, *, goods: str = "cargo", success: str = "now > 900 s") -> str:
    line = line.replace("PLACE", PLACES[number]).replace("OIL", OIL[number])
    shown = ", tank.*, tug.*" if "target tank" in line else ", swan.*" if "target swan" in line else ""
    types = TYPES.format(goods=goods) if "target tank" in line else ""
    return TEXT.format(k=(1, 3)[number], line=line, shown=shown, types=types, success=success)


def inputs(source: str) -> Inputs | None:
    """Everything that the agents receive in six ticks, by agent; None if the compiler refuses the mission."""
    compilation = compile_text(source)
    if compilation.mission is None:
        codes = {item.code for item in compilation.diagnostics if item.severity == "error"}
        assert codes <= {"LJ0404", "LJ0401"}, compilation.diagnostics
        return None
    with episode(compilation.mission, seed=1, stage=Stage()) as play:
        encode = msgspec.json.Encoder(enc_hook=lambda value: value.tobytes() if hasattr(value, "tobytes") else None)
        agents = [agent.id for agent in play.instance.agents]
        rows: Inputs = [{agent: encode.encode(brief_of(play.instance, agent)) for agent in agents}]
        for tick in range(6):
            rows.append(
                {
                    agent: encode.encode((play.published.observations[agent], play.inbox(agent), play.done))
                    for agent in agents
                }
            )
            if play.done:
                break
            sailing = does("moveTo", x=10.0 + tick % 2, y=-1350.0)
            play.do({"skipper": together(sailing, says("note", task="x", state="ok"))})
    return rows


def both(line: str, **options: str) -> tuple[Inputs | None, Inputs | None]:
    first, second = (inputs(text(line, number, **options)) for number in (0, 1))
    return first, second


@pytest.mark.parametrize("way", REFUSED)
def test_a_hidden_value_that_decides_something_is_refused(way: str) -> None:
    assert both(REFUSED[way]) == (None, None)


@pytest.mark.parametrize("way", SILENT)
def test_a_hidden_value_that_only_rules_read_shows_nothing(way: str) -> None:
    first, second = both(SILENT[way])
    assert first is not None and first == second


def test_a_condition_over_a_hidden_amount_is_refused_although_all_agents_receive_its_event() -> None:
    assert both(SILENT["hidden stock"], success="tug.cargo > 40 kg") == (None, None)
    public = SILENT["hidden stock"].replace("hidden oil", "oil")
    assert compile_text(text(public, 0, success="tug.cargo > 32 kg")).diagnostics == ()


@pytest.mark.parametrize("way", AMOUNTS)
def test_a_load_of_a_hidden_amount_needs_a_declassify_statement(way: str) -> None:
    (leak,) = compile_text(text(AMOUNTS[way], 0, goods="load")).diagnostics
    assert leak.code == "LJ0404" and "the speed and the battery of `tug`" in leak.message


# -- one guard is taken out at a time

MODEL = "lingjing.mission.conditions"
INDEXED = ("authority", "permitted body", "counted body", "picture of a member", "motion")
BODIES = ("radio range", "jammed area", "pose of pictures")


def leaking(way: str, ways: Mapping[str, str] = REFUSED) -> bool:
    first, second = both(ways[way])
    return first is not None and second is not None and first != second


@pytest.mark.parametrize("way", INDEXED)
def test_without_the_check_of_references_an_index_leaks(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"{MODEL}.exposures._read_parts", lambda value: ())
    assert leaking(way)


@pytest.mark.parametrize("way", BODIES)
def test_without_the_check_of_bodies_their_places_leak(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"{MODEL}.exposures._places_of_agents", lambda mission: ())
    monkeypatch.setattr(f"{MODEL}.exposures._receipts", lambda mission: ())
    assert leaking(way)


@pytest.mark.parametrize("way", ["event of a lasting condition", "permit after a delay", "constraint of a delay",
                                 "performed on a member", "count of a member"])  # fmt: skip
def test_without_the_check_of_the_compiler_a_condition_leaks(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lingjing.dsl.checking.leaks.leaks", lambda mission: ())
    assert leaking(way)


@pytest.mark.parametrize("way", AMOUNTS)
def test_without_the_check_of_amounts_the_goods_of_an_actor_leak(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"{MODEL}.taint._hides_amount", lambda target, interaction, of: False)
    assert leaking(way, SILENT)


SIGHTED = (
    f"asset eye : lifeboat {{ position = (60 m, -1350 m){CAMERA} }}\n"
    "  agent seer as seer controls eye { observes eye.* }\n"
    "  adjudicate known(b: box, r: detection) {\n"
    "    when k > 2 and iou(r.box, truth(b, r.frame).box) >= 0.5\n  }\n  "
)
BY_ASSIGNMENT = SIGHTED + "permit boat[1].moveTo when now < 25 s or assigned(boat[1], box[3])"


def reported(source: str) -> Inputs | None:
    """The inputs of a mission in which the guard reports a place and sends the boat there."""
    compilation = compile_text(source)
    if compilation.mission is None:
        return None
    with episode(compilation.mission, seed=1, stage=Stage(boxes={"box[3]": CENTRE_BOX})) as play:
        rows: Inputs = []
        for tick in range(6):
            rows.append({"skipper": msgspec.json.encode(play.inbox("skipper"))})
            frame = play.observation("seer").pictures[0].frame
            decision = reports("detection", frame, "locker", (-20.0, -1390.0)) if tick == 0 else Decision()
            play.do({"watch": decision, "skipper": does("moveTo", x=-20.0, y=-1390.0)})
    return rows


def test_an_assignment_to_a_reported_place_depends_on_the_rule_that_matches_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """`assigned` takes the reported place of a matched report for the place of the member: `Taint.sighted`."""
    first, second = (reported(text(BY_ASSIGNMENT, number)) for number in (0, 1))
    assert first is None and second is None
    monkeypatch.setattr(f"{MODEL}.taint._sighted", lambda of: ())
    first, second = (reported(text(BY_ASSIGNMENT, number)) for number in (0, 1))
    assert first is not None and first != second


# -- the list of public values is complete

CONDITIONS = {
    ("Mission", "success"), ("Mission", "failure"), ("Guard", "condition"), ("Rule", "condition"),
    ("Unlock", "condition"), ("Stage", "condition"), ("Stage", "deadline"), ("Permit", "condition"),
    ("Constraint", "condition"), ("EventDeclaration", "condition"), ("EventDeclaration", "until"), ("Change", "value"),
    ("Requirement", "condition"), ("PolicyExpectation", "within"), ("InfeasibleExpectation", "condition"),
    ("Origin", "draws"),
}  # fmt: skip
"""Fields with expressions that are conditions, or that no agent and no engine receives."""


EXPRESSION = get_type_hints(Mission)["success"]


def expression_fields(struct: type[msgspec.Struct], seen: set[type]) -> set[tuple[str, str]]:
    """(struct, field) of each field of a struct, and of the structs in it, that holds an expression."""
    seen.add(struct)
    fields: set[tuple[str, str]] = set()
    for name, hint in get_type_hints(struct).items():
        parts = set(_parts(hint))
        if parts & set(get_args(EXPRESSION)):
            fields.add((struct.__name__, name))
        for part in parts - seen - set(get_args(EXPRESSION)):
            if isinstance(part, type) and issubclass(part, msgspec.Struct):
                fields |= expression_fields(part, seen)
    return fields


def _parts(hint: Any) -> Iterator[Any]:
    yield hint
    for part in get_args(hint):
        yield from _parts(part)


def test_every_expression_of_a_mission_is_a_condition_or_a_public_value() -> None:
    """A new field with an expression must be added to `public_values`, or here to the conditions."""
    source = inspect.getsource(importlib.import_module(f"{MODEL}.public_values"))
    names = expression_fields(Mission, set()) - CONDITIONS
    assert len(names) > 40
    assert [(struct, name) for struct, name in sorted(names) if f".{name}" not in source] == []
