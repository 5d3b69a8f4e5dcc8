"""Conditions over hidden values reveal nothing to agents: generated missions use a hidden value in each condition.

Each mission is compiled twice, with two hidden places and nothing else that differs. If the compiler accepts it, blind
agents play both, and every input of every agent must be equal. With one guard taken out (the compiler's check, or a
rule of visibility) the same comparison finds a difference, so that it can fail.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import msgspec
import pytest

from lingjing.kernel.event_visibility import EventVisibility
from lingjing.mission.conditions.survey import Survey
from lingjing.testing import Stage, compile_text, does, episode

PLACES = ("(5 m, -1250 m)", "(45 m, -1250 m)")
"""The two hidden places: the eastern one lies in `east`, more than 110 m from the boat."""

ATOMS = (
    "victim.position.east > 25 m",
    "distance_xy(boat, victim) > 103 m",
    "victim in east",
    "far(victim)",
    "count(far(v) for v in victim) >= 1",
    "exists v in victim: v.position.east > 25 m and now >= 0 s",
    "not min(distance_xy(boat, v) for v in victim) <= 103 m",
    "distance(boat, victim) > 103 m",
    "line_of_sight(boat, victim) and victim in east",
    "speed(victim) >= 0 m/s and victim in east",
    "held(victim.position.east > 25 m, 0 s)",
    "within(now >= 0 s, far(victim), 5 s)",
    "before(victim in east, now > 1 s)",
    "count(held(far(v), 0 s) for v in victim) >= 1",
)
"""Conditions that hold for one of the two places only, from the start on."""

SLOTS = {
    "success": "success when now > 10 s and ({atom})",
    "failure": "failure when now > 10 s and ({atom})\n  success when now > 900 s",
    "permit": "permit boat.moveTo when {atom}\n  success when now > 900 s",
    "hard constraint": "constraint hard c {{ always now < 15 s or not ({atom}) }}\n  success when now > 900 s",
    "soft constraint": "constraint soft c {{ always not ({atom}), penalty = 0.1 }}\n  success when now > 900 s",
    "late stage": "stage s {{ done when {atom}, ticks <= 2 }}\n  success when now > 900 s",
    "stage after another": (
        "stage s {{ done when {atom} }}\n  stage t {{ done when now > 900 s, ticks <= 2 }}\n"
        "  relation dependency s -> t\n  success when now > 900 s"
    ),
    "limit of a stage": (
        "stage s {{ done when {atom}\n    limit moves <= 1 counts boat.moveTo }}\n  success when now > 900 s"
    ),
    "limit of a stage after another": (
        "stage s {{ done when {atom} }}\n"
        "  stage t {{ done when now > 900 s\n    limit moves <= 1 counts boat.moveTo }}\n"
        "  relation dependency s -> t\n  success when now > 900 s"
    ),
    "rule": "adjudicate seen() {{ when {atom} }}\n  success when now > 900 s",
    "unlock": "unlock open(b: box) when {atom}\n  success when now > 900 s",
    "unlock of goods": "unlock load(b: box) when {atom}\n  success when now > 900 s",
    "event": "event e when {atom} {{ weather {{ visibility = 1 km }} }}\n  success when now > 900 s",
    "event on a target": "event e when {atom} {{ change box.water to 3 kg }}\n  success when now > 900 s",
    "end of an event": (
        "event e at 1 tick until now > 15 s and ({atom}) {{ weather {{ visibility = 1 km }} }}\n"
        "  success when now > 900 s"
    ),
    "rule over a public target": "adjudicate seen(b: box) {{ when {atom} }}\n  success when now > 900 s",
}
"""Declarations in which a condition may stand, each with a success that no other one decides."""

LEAKING = {
    "success", "failure", "permit", "hard constraint", "late stage", "stage after another", "limit of a stage",
    "limit of a stage after another", "event", "event on a target", "end of an event",
}  # fmt: skip
"""Slots that the compiler must refuse."""

TEXT = """ljs 2
use std.sea {{ lifeboat, person_in_water }}
use std.messages {{ status }}

target locker {{
  engine = city
  state water = 10 kg
  interaction open {{ by = vessel, within = 60 m, status = opened }}
  interaction load {{ by = vessel, within = 60 m, gives = cargo, from = water, status = emptied }}
}}
asset tender : lifeboat {{ engine = vessel, state cargo = 0 kg }}
mission yard "Yard" {{
  goal "Wait."
  scene bay {{ datum = sea level at -3.5 m }}
  clock {{ tick = 10 s, sync = 1 s }}
  budget {{ ticks <= 100 }}
  mode broadcast
  region east = box((25 m, -1300 m), (60 m, -1200 m))
  target victim : person_in_water {{ hidden position = {place} }}
  target box : locker {{ position = (20 m, -1330 m) }}
  asset boat : tender {{ position = (10 m, -1350 m), heading = 30 deg }}
  agent skipper as rescuer controls boat {{ observes boat.*, box.*, events }}
  agent watch as guard {{ observes boat.*, box.*, events }}
  message note : status from rescuer to all
  adjudicate far(v: victim) {{ when distance_xy(boat, v) > 103 m }}
  {slot}
}}
"""

Inputs = list[dict[str, bytes]]


def text(slot: str, atom: str, place: str) -> str:
    return TEXT.format(place=place, slot=SLOTS[slot].format(atom=atom))


def inputs(mission_text: str) -> Inputs | None:
    """Everything that the agents receive in five ticks, by agent and tick; None if the compiler refuses the mission."""
    compilation = compile_text(mission_text)
    if compilation.mission is None:
        codes = {item.code for item in compilation.diagnostics if item.severity == "error"}
        late = {"LJ0613"}  # a late stage, which some slots have besides
        assert codes - late <= {"LJ0404", "LJ0401"} and codes != late, compilation.diagnostics
        return None
    with episode(compilation.mission, seed=1, stage=Stage()) as play:
        rows: Inputs = []
        for tick in range(5):
            rows.append(
                {
                    agent: msgspec.msgpack.encode(
                        (
                            play.published.record.tick, seen.time_s, seen.entities, seen.cells, seen.events,
                            seen.weather, play.inbox(agent).messages, play.inbox(agent).receipts, play.done,
                        )
                    )
                    for agent, seen in play.published.observations.items()
                }
            )  # fmt: skip
            if play.done:
                break
            play.do({"skipper": does("moveTo", x=10.0 + tick % 2, y=-1350.0)})
    return rows


def both(slot: str, atom: str) -> tuple[Inputs | None, Inputs | None]:
    first, second = (inputs(text(slot, atom, place)) for place in PLACES)
    return first, second


@pytest.mark.parametrize("slot", SLOTS)
@pytest.mark.parametrize("atom", ATOMS)
def test_a_condition_over_a_hidden_value_is_refused_or_shows_nothing(slot: str, atom: str) -> None:
    first, second = both(slot, atom)
    assert (first is None) == (second is None) == (slot in LEAKING)
    assert first == second


@pytest.mark.parametrize("slot", sorted(LEAKING))
def test_without_the_check_of_the_compiler_the_comparison_finds_the_leak(
    slot: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lingjing.dsl.checking.leaks.leaks", lambda mission: ())
    differing = [atom for atom in ATOMS[:2] if (pair := both(slot, atom))[0] is not None and pair[0] != pair[1]]
    assert differing == list(ATOMS[:2])


MOTIONS = {
    "flee": "behaviour flee {{ from = victim, speed = 2 m/s, within = 500 m }}",
    "follow": "behaviour follow {{ of = victim, speed = 2 m/s, distance = 10 m }}",
    "wander": "behaviour wander {{ in = near, speed = 2 m/s }}",
}
"""Behaviours of a target that a hidden place directs."""


def moved(motion: str, place: str, *, hidden: bool) -> Inputs | None:
    """The inputs of a mission in which a swimmer moves by the hidden place; None if the compiler refuses it."""
    mark = "hidden " if hidden else ""
    line = f"target swan : person_in_water {{{{ {mark}position = (20 m, -1200 m), {MOTIONS[motion]} }}}}"
    near = "region near = circle(victim, 20 m)"
    seen = TEXT.replace("observes boat.*, box.*", "observes boat.*, box.*" + ("" if hidden else ", swan.*"))
    slot = f"{near}\n  {line}\n  success when now > 900 s".format()
    return inputs(seen.format(place=place, slot=slot))


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_target_that_moves_by_a_hidden_place_is_refused_or_hidden_itself(motion: str) -> None:
    assert [moved(motion, place, hidden=False) for place in PLACES] == [None, None]
    first, second = (moved(motion, place, hidden=True) for place in PLACES)
    assert first is not None and first == second


@pytest.mark.parametrize("motion", MOTIONS)
def test_without_the_check_of_behaviours_the_comparison_finds_the_leak(
    motion: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lingjing.mission.conditions.exposures.exposures", lambda mission: ())
    first, second = (moved(motion, place, hidden=False) for place in PLACES)
    assert first is not None and first != second


GUARDS: Mapping[str, tuple[object, str, object]] = {
    "unlock": (EventVisibility, "_is_secret", lambda self, interaction, group: False),
    "unlock of goods": (EventVisibility, "withheld", lambda self, agent, entity: frozenset()),
    "rule": (Survey, "open_events", frozenset({"seen"})),
    "rule over a public target": (Survey, "open_events", frozenset({"seen"})),
}


@pytest.mark.parametrize("slot", GUARDS)
def test_without_a_rule_of_visibility_the_comparison_finds_the_leak(slot: str, monkeypatch: pytest.MonkeyPatch) -> None:
    owner, name, open_guard = GUARDS[slot]
    monkeypatch.setattr(owner, name, open_guard)
    first, second = both(slot, ATOMS[0])
    assert first is not None and first != second


def test_every_declaration_with_a_condition_has_a_slot() -> None:
    """A new kind of condition must be added here as well as to the survey."""
    from typing import get_args

    from lingjing.mission.conditions.survey import ConditionKind

    kinds = {kind.rstrip("s") for kind in get_args(ConditionKind)}
    assert all(any(kind.removesuffix("es") in slot or kind in slot for slot in SLOTS) for kind in kinds - {"succes"})
    assert len(set(itertools.product(SLOTS, ATOMS))) >= 80
