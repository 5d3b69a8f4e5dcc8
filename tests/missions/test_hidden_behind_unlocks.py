"""Hidden values behind `unlock`s of interactions with public targets: pairs of missions that differ only in them.

The hidden value unlocks an interaction, which changes a public target and its actor. Each mission reads one of the
changed things in one place that decides something. The compiler refuses it, or blind agents receive equal inputs. With
one guard taken out, the same comparison finds a difference.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec
import pytest

from lingjing.testing import Stage, compile_text, does, episode

PLACES = ("(5 m, -1250 m)", "(45 m, -1250 m)")
"""The two hidden places: the eastern one unlocks."""

TEXT = """ljs 2
use std.sea {{ lifeboat, person_in_water }}
use std.messages {{ report, status }}

target locker {{
  engine = city
  state water = 10 kg
  state heat = 1
  interaction open {{ by = vessel, within = 60 m, status = opened{told} }}
  interaction fill {{ by = vessel, within = 60 m, gives = {cargo}, from = water, status = emptied{told} }}
  interaction knock {{ by = vessel, within = 60 m, status = knocked{told} }}
}}
target raft {{
  engine = city
  drift = 0.3 m/s
  interaction haul {{ by = vessel, within = 60 m, aboard = true{told} }}
}}
asset tender : lifeboat {{ engine = vessel, state {cargo} = 0 kg }}
mission yard "Yard" {{
  goal "Wait."
  scene bay {{ datum = sea level at -3.5 m }}
  clock {{ tick = 10 s, sync = 1 s }}
  budget {{ ticks <= 100 }}
  weather {{ current = 0.3 m/s to 60 deg }}
  mode broadcast
  region east = box((25 m, -1300 m), (60 m, -1200 m))
  target victim : person_in_water {{ hidden position = {place} }}
  target box : locker {{ position = (20 m, -1330 m) }}
  target buoy : raft {{ position = (30 m, -1340 m) }}
  asset boat : tender {{ position = (10 m, -1350 m), heading = 30 deg }}
  agent skipper as rescuer controls boat {{ observes boat.*, box.*, buoy.*, events }}
  agent watch as guard {{ observes boat.*, box.*, buoy.*{watched} }}
  message note : status from rescuer to all
  adjudicate far(v: victim) {{ when v in east }}
  {unlock}
  {slot}
}}
"""

READS = {
    "emitted(open)": "open",
    "emitted(open, box)": "open",
    "count(open, box) >= 1": "open",
    "count(open) >= 1": "open",
    "box.status == opened": "open",
    "box.heat < 0.5": "open",
    "opened(box)": "open",
    "emitted(knock, box)": "two unlocks",
    "box.water < 9 kg": "fill",
    "boat.cargo > 0 kg": "fill",
    "sum(b.cargo for b in boat) > 0 kg": "fill",
    "held(emitted(fill), 0 s)": "fill",
    "distance_xy(boat, buoy) < 1 m": "haul",
}
"""A condition over what an interaction changes → the unlocks of `UNLOCKS`."""

UNLOCKS = {
    "open": "unlock open(b: box) when {secret}\n  adjudicate opened(b: box) {{ when emitted(open, b) }}",
    "fill": "unlock fill(b: box) when {secret}",
    "haul": "unlock haul(b: buoy) when {secret}",
    "two unlocks": "unlock open(b: box) when {secret}\n  unlock knock(b: box) when box.heat < 0.5",
}
"""The unlock of the interaction that a read is about."""

CLOSED = {
    "open": "unlock open(b: box) when now > 9000 s",
    "fill": "unlock fill(b: box) when now > 9000 s",
    "knock": "unlock knock(b: box) when now > 9000 s",
    "haul": "unlock haul(b: buoy) when now > 9000 s",
}
"""The unlocks of all other interactions, which never hold."""

GATES = {
    "success": "success when now > 20 s and ({read})",
    "failure": "failure when now > 20 s and ({read})\n  success when now > 900 s",
    "permit": "permit boat.moveTo when {read}",
    "hard constraint": "constraint hard c {{ always now < 25 s or not ({read}) }}",
    "late stage": "stage s {{ done when {read}, ticks <= 3 }}",
    "late stage after another": (
        "stage s {{ done when {read} }}\n  stage t {{ done when now > 900 s, ticks <= 2 }}\n"
        "  relation dependency s -> t"
    ),
    "deadline": "stage s {{ done when {read}, deadline = 35 s }}",
    "limit of a stage": "stage s {{ done when {read}\n    limit moves <= 1 counts boat.moveTo }}",
    "event": "event e when {read} {{ weather {{ visibility = 1 km }} }}",
    "event on the radio": "event e when {read} {{ comms {{ loss = 80 % }} }}",
    "end of an event": "event e at 1 tick until now > 25 s and ({read}) {{ weather {{ visibility = 1 km }} }}",
    "value of an event": "event e at 3 tick {{ change box.water to {value} }}",
    "rule": "adjudicate seen() {{ when {read} }}",
    "rule over the target": "adjudicate seen(b: box) {{ when {read} }}",
    "soft constraint": "constraint soft c {{ always not ({read}), penalty = 0.1 }}",
    "stage": "stage s {{ done when {read} }}",
}
"""Declarations that decide something by a condition."""

SILENT = {"rule", "rule over the target", "soft constraint", "stage"}
"""Gates that show nothing: the kernel withholds their events."""

VALUES = {"box.water < 9 kg": "box.water", "boat.cargo > 0 kg": "boat.cargo"}
"""Reads that an event may copy."""

PAIRS = [(gate, read) for gate in GATES for read in READS if gate != "value of an event" or read in VALUES]

Inputs = list[dict[str, bytes]]


def text(
    gate: str, read: str, place: str, *, audience: str = "", cargo: str = "cargo", watched: str = ", events"
) -> str:
    unlock = UNLOCKS[READS[read]].format(secret="far(victim)")
    closed = [line for name, line in CLOSED.items() if f"unlock {name}(" not in unlock]
    slot = GATES[gate].format(read=read, value=VALUES.get(read, ""))
    slot += "" if "success" in slot else "\n  success when now > 900 s"
    unlocks = "\n  ".join((unlock, *closed))
    word = f", told = {audience}" if audience else ""
    return TEXT.format(place=place, unlock=unlocks, slot=slot, told=word, cargo=cargo, watched=watched)


def inputs(mission_text: str) -> Inputs | None:
    """Everything that the agents receive in six ticks, by agent and tick; None if the compiler refuses the mission."""
    compilation = compile_text(mission_text)
    if compilation.mission is None:
        codes = {item.code for item in compilation.diagnostics if item.severity == "error"}
        assert codes <= {"LJ0404", "LJ0401"}, compilation.diagnostics
        return None
    with episode(compilation.mission, seed=1, stage=Stage()) as play:
        rows: Inputs = []
        for tick in range(6):
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


def both(gate: str, read: str, **options: str) -> tuple[Inputs | None, Inputs | None]:
    first, second = (inputs(text(gate, read, place, **options)) for place in PLACES)
    return first, second


@pytest.mark.parametrize(("gate", "read"), PAIRS)
def test_an_interaction_unlocked_by_a_hidden_value_is_refused_or_shows_nothing(gate: str, read: str) -> None:
    first, second = both(gate, read)
    assert (first is None) == (second is None) == (gate not in SILENT)
    assert first == second


@pytest.mark.parametrize("read", READS)
def test_a_success_that_may_leak_needs_only_a_declassify_statement(read: str) -> None:
    declared = text("success", read, PLACES[0]).replace("  success", '  declassify end because "x"\n  success')
    assert compile_text(declared).diagnostics == ()


def test_an_interaction_that_every_agent_sees_is_public() -> None:
    """`told = all` shows the event to agents that observe events. It is no secret where all of them do."""
    observed = compile_text(text("permit", "emitted(open)", PLACES[0], audience="all"))
    assert observed.diagnostics == ()
    blind = compile_text(text("permit", "emitted(open)", PLACES[0], audience="all", watched=""))
    assert [item.code for item in blind.diagnostics] == ["LJ0404"]
    assert "`open` changes" in blind.diagnostics[0].message


def test_a_secretly_changed_load_leaks_through_the_motion_of_the_asset() -> None:
    secret, public = (
        text("stage", "box.water < 9 kg", PLACES[0], audience=audience, cargo="load") for audience in ("", "all")
    )
    (leak,) = compile_text(secret).diagnostics
    assert leak.code == "LJ0404" and "the speed and the battery of `boat`" in leak.message
    assert compile_text(public).diagnostics == ()
    assert compile_text(secret.replace("  success", '  declassify fill because "x"\n  success')).diagnostics == ()


# -- one guard is taken out at a time


def leaking(gate: str, read: str) -> bool:
    first, second = both(gate, read)
    return first is not None and second is not None and first != second


MODEL = "lingjing.mission.conditions"
VISIBILITY = "lingjing.kernel.event_visibility.EventVisibility"

MUTANTS: Mapping[str, tuple[str, object, tuple[str, ...]]] = {
    "no taint": (f"{MODEL}.survey.propagate", lambda declarations, *, shown=False: declarations, tuple(READS)),
    "no fields of the target": (
        f"{MODEL}.taint.changed_fields",
        lambda group, interaction: (),
        ("box.status == opened", "box.heat < 0.5", "distance_xy(boat, buoy) < 1 m"),  # `moved_fields` has the water
    ),
    "no stock of the actor": (f"{MODEL}.taint.carried_fields", lambda of, interaction: (), ("boat.cargo > 0 kg",)),
    "no level that is worked off": (f"{MODEL}.taint._level", lambda group: {}, ("box.heat < 0.5",)),
    "no second round": (
        f"{MODEL}.taint._reads_hidden",
        lambda unlock, target, of: unlock.interaction == "open",
        ("emitted(knock, box)",),
    ),
    "no events of interactions": (
        f"{MODEL}.reads.Reader._is_secret",
        lambda self, interaction, named: False,
        ("emitted(open)", "count(open) >= 1", "count(open, box) >= 1", "held(emitted(fill), 0 s)"),
    ),
}
"""Guard → the attribute that is replaced, the replacement, and the reads with which a gate then leaks."""


@pytest.mark.parametrize("mutant", MUTANTS)
@pytest.mark.parametrize("gate", sorted(GATES.keys() - SILENT - {"value of an event"}))
def test_without_a_guard_of_the_model_a_gate_leaks(mutant: str, gate: str, monkeypatch: pytest.MonkeyPatch) -> None:
    attribute, replacement, reads = MUTANTS[mutant]
    monkeypatch.setattr(attribute, replacement)
    some = reads if gate == "permit" else reads[:1]  # every read in one gate, and one read in every gate
    assert [read for read in some if leaking(gate, read)] == list(some)


@pytest.mark.parametrize("gate", ["rule", "rule over the target", "soft constraint"])
def test_without_taint_the_kernel_publishes_verdicts(gate: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"{MODEL}.reads.Reader._is_secret", lambda self, interaction, named: False)
    assert leaking(gate, "emitted(open)")


@pytest.mark.parametrize("read", ["box.status == opened", "box.heat < 0.5", "boat.cargo > 0 kg", "box.water < 9 kg",
                                  "distance_xy(boat, buoy) < 1 m"])  # fmt: skip
def test_without_withheld_fields_the_observations_show_the_interaction(
    read: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"{VISIBILITY}.withheld", lambda self, agent, entity: frozenset())
    assert leaking("stage", read)


QUEUE = """ljs 2
use std.sea {{ lifeboat }}
target shop {{ engine = city, state people = 3, arrivals = 0.01 Hz }}
mission wait "Wait" {{
  goal "Wait."
  scene bay {{ datum = sea level at -3.5 m }}
  clock {{ tick = 10 s, sync = 1 s }}
  budget {{ ticks <= 100 }}
  mode single
  target store : shop {{ position = (20 m, -1330 m), hidden arrivals = {rate} Hz }}
  asset boat : lifeboat {{ position = (10 m, -1350 m), heading = 30 deg }}
  agent skipper as rescuer controls boat {{ observes boat.*, {observed} }}
  success when now > 900 s
}}
"""


@pytest.mark.parametrize(
    ("observed", "refused"), [("store.*", True), ("store.people", True), ("store.position", False)]
)
def test_a_public_number_of_people_reveals_a_hidden_arrival_rate(
    observed: str, refused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow, fast = (inputs(QUEUE.format(rate=rate, observed=observed)) for rate in ("0.01", "0.4"))
    assert (slow is None) == (fast is None) == refused
    assert slow == fast
    monkeypatch.setattr(f"{MODEL}.exposures.exposures", lambda mission: ())
    slow, fast = (inputs(QUEUE.format(rate=rate, observed=observed)) for rate in ("0.01", "0.4"))
    assert slow is not None and (slow != fast) == refused


def test_a_public_target_that_follows_a_secretly_hauled_target_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernel withholds the place of the raft. A swan with a public place that follows the raft would reveal it."""
    behaviour = "behaviour follow { of = buoy, speed = 2 m/s, distance = 2 m }"
    swan = f"target swan : person_in_water {{ position = (60 m, -1400 m), {behaviour} }}"
    sources = [
        text("stage", "distance_xy(boat, buoy) < 1 m", place)
        .replace("  adjudicate far", f"  {swan}\n  adjudicate far")
        .replace("buoy.*, events", "buoy.*, swan.*, events")
        for place in PLACES
    ]
    assert [inputs(source) for source in sources] == [None, None]
    monkeypatch.setattr(f"{MODEL}.exposures.exposures", lambda mission: ())
    first, second = map(inputs, sources)
    assert first is not None and first != second
