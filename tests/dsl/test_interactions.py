"""Interactions: the actor, the declared states that they change, their dimensions; and the rules for states."""

from __future__ import annotations

import re

import msgspec
import pytest

from lingjing.dsl.loading.load import proofs
from lingjing.dsl.pages.judging import judging
from lingjing.mission import document
from lingjing.mission.graph import graph
from lingjing.mission.interactions import UNSAID
from lingjing.testing import compile_text, instantiate
from lingjing.testing import declarations as model
from lingjing.testing import expressions as ex
from lingjing.testing.missions import SourceText

TYPES = """\
ljs 1
use std.ground { car }
asset coach : car {
  state riders = 0
  seats = 30
}
target stop {
  engine = city
  state people = 4
  state parcels = 9 kg
  weight = 80 kg
  interaction board { by = road, within = 20 m, gives = riders, up_to = seats, from = people }
}
"""
MISSION = """\
mission bus "A bus stop" {
  goal "Fetch everybody."
  scene residential { extent = 400 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 20 }
  target corner : stop { position = (50 m, 50 m) }
  asset bus : coach { position = (0 m, 0 m) }
  agent driver as driver controls bus { observes bus.* }
  unlock board(s: corner) when now >= 0 s
  success when corner.people <= 0
}
"""
BOARD = "interaction board { by = road, within = 20 m, gives = riders, up_to = seats, from = people }"

# text in place of the interaction; code, line, column, a part of the message
OF_A_TYPE = [
    ("{ by = rocket, within = 1 m }", "LJ0125", 12, 28, "no known asset has the engine `rocket`"),
    ("{ by = coach, within = 1 m }", "LJ0125", 12, 28, "the engine `coach`"),
    ("{ by = city, within = 1 m }", "LJ0125", 12, 28, "the engine `city`"),
    ("{ by = road }", "LJ0106", 12, 15, "lacks `within`"),
    ("{ within = 1 m }", "LJ0106", 12, 15, "lacks `by`"),
    ("{ by = road, within = 1 m, gives = riders, from = nothing }", "LJ0126", 12, 71, "`nothing`, which is no state"),
    ("{ by = road, within = 1 m, gives = riders, from = weight }", "LJ0126", 12, 71, "`weight`, which is no state"),
    ("{ by = road, within = 1 m, takes = peple }", "LJ0126", 12, 56, "`peple`, which is no state"),
    ("{ by = road, within = 1 m, gives = riders }", "LJ0106", 12, 15, "gives `riders` without a limit"),
    ("{ by = road, within = 1 m, gives = riders, takes = people }", "LJ0110", 12, 48, "both takes and gives"),
    ("{ by = road, within = 1 m, from = people }", "LJ0110", 12, 48, "has `from`, but neither takes nor gives"),
    ("{ by = road, within = 1 m, takes = people, up_to = seats }", "LJ0110", 12, 64, "has `up_to`, but gives nothing"),
]  # fmt: skip
IN_A_MISSION = [
    ("gives = cargo_hold, from = people", "LJ0126", "`cargo_hold` of a `road` asset, which is no state"),
    ("takes = people, from = hold", "LJ0126", "takes from the `hold` of a `road` asset"),
    ("gives = riders, from = people, up_to = wings", "LJ0126", "up to its `wings`, which it does not have"),
    ("gives = load, from = people", "LJ0210", "`bus.load` is a mass, `corner.people` a bare number"),
    ("gives = riders, from = parcels", "LJ0210", "`bus.riders` is a bare number, `corner.parcels` a mass"),
    ("gives = riders, up_to = payload", "LJ0210", "`bus.riders` is a bare number, `bus.payload` a mass"),
    ("gives = seats, from = people", "LJ0126", "`seats` of a `road` asset, which is no state of `bus`"),
    ("takes = parcels, from = riders", "LJ0210", "`bus.riders` is a bare number, `corner.parcels` a mass"),
]  # fmt: skip


def errors_of(text: str) -> list[tuple[str, int, int]]:
    return [(item.code, item.span.line, item.span.column) for item in compile_text(text).diagnostics]


def test_the_bus_stop_example_has_no_errors() -> None:
    assert compile_text(TYPES).diagnostics == ()
    assert compile_text(TYPES + MISSION).diagnostics == ()


@pytest.mark.parametrize(("block", "code", "line", "column", "part"), OF_A_TYPE, ids=lambda value: str(value)[:30])
def test_a_faulty_interaction_of_a_type_gives_one_error(
    block: str, code: str, line: int, column: int, part: str
) -> None:
    text = TYPES.replace(BOARD, f"interaction board {block}")
    (diagnostic,) = compile_text(text).diagnostics
    assert (diagnostic.code, diagnostic.span.line, diagnostic.span.column) == (code, line, column)
    assert part in diagnostic.message


@pytest.mark.parametrize(("moves", "code", "part"), IN_A_MISSION, ids=lambda value: str(value)[:30])
def test_an_interaction_that_does_not_fit_the_states_of_its_actor_gives_one_error(
    moves: str, code: str, part: str
) -> None:
    changed = f"interaction board {{ by = road, within = 20 m, {moves} }}"
    assert compile_text(TYPES.replace(BOARD, changed)).diagnostics == ()
    (diagnostic,) = compile_text(TYPES.replace(BOARD, changed) + MISSION).diagnostics
    assert (diagnostic.code, diagnostic.span.line, diagnostic.span.column) == (code, 19, 19)
    assert part in diagnostic.message


def test_an_unused_interaction_is_no_error() -> None:
    also = "\n  interaction shower { by = vessel, within = 9 m, gives = hold, from = people }"
    assert compile_text(TYPES.replace(BOARD, BOARD + also) + MISSION).diagnostics == ()


def test_one_asset_with_the_state_is_enough_for_an_interaction() -> None:
    more = "  asset taxi : car { position = (9 m, 0 m) }\n  agent other as other controls taxi { observes taxi.* }\n"
    assert compile_text(TYPES + MISSION.replace("  agent driver", f"{more}  agent driver")).diagnostics == ()


def test_the_field_by_can_name_a_role_of_the_mission_in_the_file() -> None:
    types = TYPES.replace(BOARD, BOARD.replace("by = road", "by = driver"))
    compilation = compile_text(types + MISSION)
    assert compilation.mission is not None and compilation.diagnostics == ()
    instance = instantiate(compilation.mission)
    (board,) = next(entity for entity in instance.entities if entity.id == "corner").interactions
    assert [actor.id for actor in instance.actors(board)] == ["bus"]
    (alone,) = compile_text(types).diagnostics
    assert (alone.code, alone.message) == ("LJ0125", "no known asset has the engine `driver`")
    (typo,) = compile_text(types.replace("by = driver", "by = drivr") + MISSION).diagnostics
    assert typo.message.endswith("and no agent has the role `drivr`") and "`driver`" in typo.hint
    (stateless,) = compile_text(types + MISSION.replace("bus : coach", "bus : car")).diagnostics
    assert (stateless.code, "of a `driver` asset, which is no state of `bus`" in stateless.message) == ("LJ0126", True)


def test_only_assets_that_the_named_role_controls_are_actors() -> None:
    taxi = "  asset taxi : coach { position = (9 m, 0 m) }\n  agent other as other controls taxi { observes taxi.* }\n"
    types = TYPES.replace(BOARD, BOARD.replace("by = road", "by = other"))
    compilation = compile_text(types + MISSION.replace("  agent driver", f"{taxi}  agent driver"))
    assert compilation.mission is not None and compilation.diagnostics == ()
    instance = instantiate(compilation.mission)
    (board,) = next(entity for entity in instance.entities if entity.id == "corner").interactions
    assert [actor.id for actor in instance.actors(board)] == ["taxi"]
    rows = [row for row in judging(compilation.mission) if row[0] == "board (corner)"]
    assert [row[1] for row in rows] == ["the role `other`"]
    edges = {(edge.source, edge.target) for edge in graph(compilation.mission).edges}
    assert ("event:board", "asset:taxi") in edges and ("event:board", "asset:bus") not in edges


def test_engines_of_the_files_asset_types_are_known() -> None:
    rocket = "asset rocket { engine = booster, verb launch() }\n"
    by = BOARD.replace("by = road", "by = booster")
    assert compile_text(TYPES.replace(BOARD, by) + rocket).diagnostics == ()


def test_an_extending_type_declares_only_differences() -> None:
    wider = "target square : stop { people = 7, interaction board { within = 40 m } }\n"
    compilation = compile_text(TYPES + wider + MISSION.replace(": stop", ": square"))
    assert compilation.mission is not None and compilation.diagnostics == ()
    (corner,) = (group for group in compilation.mission.groups if group.name == "corner")
    assert next(prop for prop in corner.properties if prop.name == "people").state


@pytest.mark.parametrize(
    ("line", "code", "column"),
    [
        ("state colour = white", "LJ0201", 18),
        ("state lit = true", "LJ0201", 15),
        ("state reach = 1 m..2 m", "LJ0201", 17),
        ("state heading = 3 deg", "LJ0110", 3),
        ("state load_kg = 5", "LJ0202", 9),
        ("arrivals = 0.1 Hz", "LJ0106", 8),
    ],
)
def test_a_state_must_be_a_number_with_a_permitted_name(line: str, code: str, column: int) -> None:
    number = 7 if code == "LJ0106" else 9
    text = TYPES.replace("state people = 4\n", f"{line}\n").replace(f"\n  {BOARD}", "")
    assert errors_of(text) == [(code, number, column)]


# -- the same in a mission.json


def as_json(interaction: str) -> set[tuple[str, str]]:
    """Code and message of all errors of the bus stop with this interaction, written as JSON."""
    mission = compile_text(TYPES + MISSION).mission
    assert mission is not None
    words = dict(re.findall(r"(\w+) = (\w+)", interaction.replace("from =", "source =")))
    within = ex.Number(value=1.0, unit="m") if "within" in words else UNSAID
    words = {key: value for key, value in words.items() if key not in ("within", "lasting")}
    board = model.Interaction(**{"name": "board", "by": "", **words}, within=within)
    stop, *others = sorted(mission.groups, key=lambda group: group.name != "corner")
    changed = msgspec.structs.replace(mission, groups=(msgspec.structs.replace(stop, interactions=(board,)), *others))
    read = document.decode(document.encode(changed), "m.json")
    return {
        (interaction.code, interaction.message)
        for interaction in proofs(read, SourceText("m.json", document.encode(changed)))
    }


@pytest.mark.parametrize(
    "interaction",
    [*(words for words, *_ in OF_A_TYPE), *(f"{{ by = road, within = 1 m, {words} }}" for words, *_ in IN_A_MISSION)],
)
def test_a_document_has_the_errors_of_its_text(interaction: str) -> None:
    text = (TYPES + MISSION).replace(BOARD, f"interaction board {interaction}")
    diagnostics = {(item.code, item.message) for item in compile_text(text).diagnostics if item.severity == "error"}
    refused = {(code, message.removeprefix("bus/corner: ")) for code, message in as_json(interaction)}
    # checking a text stops at a faulty type; its roles are those of the file's missions
    assert diagnostics and diagnostics <= refused, (diagnostics, refused)


def test_a_good_document_is_not_refused() -> None:
    assert as_json(BOARD.removeprefix("interaction board ")) == set()


@pytest.mark.parametrize("value", [ex.Text(value="many"), ex.Symbol(name="many"), ex.Flag(value=True)])
def test_a_state_of_a_document_is_a_number(value: ex.Expr) -> None:
    mission = compile_text(TYPES + MISSION).mission
    assert mission is not None

    def spoilt(group: model.Group) -> model.Group:
        old = group.properties
        new = (
            msgspec.structs.replace(declared, value=value) if declared.name == "people" else declared
            for declared in old
        )
        return msgspec.structs.replace(group, properties=tuple(new))

    groups = tuple(map(spoilt, mission.groups))
    text = document.encode(msgspec.structs.replace(mission, groups=groups))
    (diagnostic,) = proofs(document.decode(text, "m.json"), SourceText("m.json", text))
    assert (diagnostic.code, diagnostic.message) == (
        "LJ0201",
        "bus/corner: `people` of `corner` is a state and no number",
    )
