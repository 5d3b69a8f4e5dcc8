"""Missions that extend others, and files that use their neighbours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lingjing.dsl.checking import inherit
from lingjing.dsl.syntax.parser import Parser
from lingjing.testing import Compilation, compile_file, instantiate
from lingjing.testing import expressions as ex


@pytest.fixture
def project(tmp_path: Path, small: str) -> Path:
    """A project's folder with the small mission in it."""
    (tmp_path / "base.ljs").write_text(small)
    return tmp_path


def compiled(project: Path, inside: str, head: str = "use .base { small }", name: str = "night") -> Compilation:
    """The mission `night extends small` with these statements."""
    file = project / f"{name}.ljs"
    file.write_text(f'ljs 1\n{head}\nmission {name} extends small "At night" {{\n{inside}\n}}\n')
    return compile_file(str(file))


def codes(compilation: Compilation) -> list[tuple[str, int]]:
    return [(item.code, item.span.line) for item in compilation.diagnostics]


def test_a_derived_mission_has_the_declarations_of_its_base(project: Path) -> None:
    compilation = compiled(project, "")
    assert compilation.diagnostics == ()
    base = compile_file(str(project / "base.ljs")).mission
    assert compilation.mission is not None and base is not None
    assert (compilation.mission.name, compilation.mission.title, compilation.mission.base) == (
        "night",
        "At night",
        "small",
    )
    assert compilation.mission.groups == base.groups
    assert compilation.mission.rules == base.rules
    assert compilation.mission.success == base.success


def test_an_override_keeps_the_position_of_the_original_and_additions_come_last(project: Path) -> None:
    compilation = compiled(project, "  override param uavs = 4 in 1..10\n  param extra = 1")
    assert compilation.diagnostics == ()
    assert compilation.mission is not None
    assert [(p.name, p.default) for p in compilation.mission.parameters] == [
        ("uavs", ex.Number(4.0)),
        ("altitude", ex.Number(100.0, "m")),
        ("extra", ex.Number(1.0)),
    ]
    assert len(instantiate(compilation.mission, mode="broadcast").agents) == 5


def test_an_unreadable_override_is_reported_once(project: Path) -> None:
    compilation = compiled(project, "  override scene { layout = 3 }\n  override region search")
    assert codes(compilation) == [("LJ0010", 4), ("LJ0010", 5)]


def test_an_override_keeps_the_lines_that_it_does_not_mention(project: Path) -> None:
    compilation = compiled(
        project, "  override weather { visibility = 2 km }\n  override asset boat { speed <= 5 m/s }"
    )
    assert compilation.diagnostics == ()
    assert compilation.mission is not None
    assert {prop.name: prop.value for prop in compilation.mission.weather} == {
        "wind_mps": ex.Number(4.0, "m/s"),
        "wind_from_deg": ex.Number(220.0, "deg"),
        "visibility_m": ex.Number(2000.0, "km"),
    }
    boat = next(group for group in compilation.mission.groups if group.name == "boat")
    values = {prop.name: prop.value for prop in boat.properties}
    assert values["speed_mps"] == ex.Number(5.0, "m/s")
    assert values["heading_deg"] == ex.Number(30.0, "deg")
    assert boat.type == "lifeboat"


def test_a_base_may_have_a_base(project: Path) -> None:
    compiled(project, "  override param uavs = 4 in 1..10", name="night")
    head = "use .night { night }"
    (project / "later.ljs").write_text(f"ljs 1\n{head}\nmission later extends night {{ param more = 2 }}\n")
    compilation = compile_file(str(project / "later.ljs"))
    assert compilation.diagnostics == ()
    assert compilation.mission is not None
    assert [p.default for p in compilation.mission.parameters][:1] == [ex.Number(4.0)]
    assert compilation.mission.parameters[-1].name == "more"


def test_a_mission_that_extends_a_shipped_one_can_turn_its_asset_into_a_group(tmp_path: Path) -> None:
    (tmp_path / "more.ljs").write_text(
        "ljs 1\nuse scenarios.vdn { vdn }\nmission more extends vdn {\n  override mode broadcast\n"
        "  override asset dog[1..3] { position = at(i, [(-60 m, 0 m)], spread 3 m) }\n"
        "  override agent navigator[i in 1..3] as navigator controls dog[i] { observes dog[i].* }\n"
        "  override stage enter { done when exists d in dog: d in compound }\n"
        "  override stage approach { done when exists d in dog: distance_xy(d, home) <= 90 m }\n"
        "  override unlock arrive(h: home) when now >= 0 s\n"
        "  override adjudicate arrived(h: home) { when emitted(arrive, h) }\n}\n"
    )
    compilation = compile_file(str(tmp_path / "more.ljs"))
    assert compilation.diagnostics == () and compilation.mission is not None
    dogs = [entity for entity in instantiate(compilation.mission).entities if entity.group == "dog"]
    assert [dog.id for dog in dogs] == ["dog[1]", "dog[2]", "dog[3]"]
    assert {(dog.heading_deg, dog.cameras[0].name) for dog in dogs} == {(90.0, "front")}, "the base's lines are kept"


def test_a_permit_and_the_hub_are_overridden(tmp_path: Path) -> None:
    def extended(body: str) -> Compilation:
        file = tmp_path / "more.ljs"
        file.write_text(f"ljs 1\nuse scenarios.upr {{ upr }}\nmission more extends upr {{\n{body}\n}}\n")
        return compile_file(str(file))

    plain = extended(
        "override mode broadcast\noverride comms { hub = none }\noverride permit dog.forward when now >= 0 s"
    )
    assert plain.diagnostics == () and plain.mission is not None and plain.mission.comms.hub is None
    assert len(plain.mission.permits) == 1
    lacking = extended("override comms { hub = none }")
    assert codes(lacking) == [("LJ0502", 3)], "star mode needs one"
    assert lacking.diagnostics[0].hint.endswith("or leave `star` out of `mode`")
    assert codes(extended("permit dog.forward when now >= 0 s")) == [("LJ0124", 4)]


def test_changing_a_declaration_of_the_base_needs_override(project: Path) -> None:
    compilation = compiled(project, "  param uavs = 4 in 1..10")
    assert codes(compilation) == [("LJ0124", 4)]
    fix = compilation.diagnostics[0].fix
    assert fix is not None and fix.edits[0].text == "override param"
    assert compilation.diagnostics[0].related[0].span.path.endswith("base.ljs")


def test_only_declarations_of_the_base_can_be_overridden(project: Path) -> None:
    compilation = compiled(project, "  override param uafs = 4 in 1..10")
    assert codes(compilation) == [("LJ0123", 4)]
    assert compilation.diagnostics[0].hint == "did you mean `uavs`?"


def test_an_override_that_breaks_the_base_is_reported_in_the_derived_mission(project: Path) -> None:
    compilation = compiled(project, "  override target victim[1..1] : person_in_water { position = (1 m, 2 m) }")
    assert compilation.diagnostics == ()
    compilation = compiled(
        project, "  override param altitude = 3 s\n  override asset uav : lifeboat { position = (1 m, 2 m) }"
    )
    assert {(item.code, item.span.line) for item in compilation.diagnostics} == {("LJ0201", 3)}
    assert compilation.diagnostics[0].related[0].span.path.endswith("base.ljs")
    assert compilation.diagnostics[0].related[0].span.line == 27


def test_a_faulty_base_gives_one_error(project: Path, small: str) -> None:
    (project / "base.ljs").write_text(small.replace("tick = 10 s", "tick = 10 m"))
    compilation = compiled(project, "  param extra = 1")
    assert codes(compilation) == [("LJ0119", 3)]


def test_an_unknown_base_is_an_error(project: Path) -> None:
    assert codes(compiled(project, "", head="use std.air")) == [("LJ0101", 3)]


def test_a_cycle_of_files_ends_in_a_diagnostic(project: Path) -> None:
    (project / "one.ljs").write_text("ljs 1\nuse .two\nrecord a : other { }\n")
    (project / "two.ljs").write_text("ljs 1\nuse .one\nrecord b : other { }\n")
    compilation = compile_file(str(project / "one.ljs"))
    assert [item.code for item in compilation.diagnostics] == ["LJ0119"]
    assert "one.ljs → two.ljs → one.ljs" in compilation.diagnostics[0].related[0].message
    (project / "me.ljs").write_text("ljs 1\nuse .me\nrecord a : other { }\n")
    assert [item.code for item in compile_file(str(project / "me.ljs")).diagnostics] == ["LJ0120"]


def test_missions_that_extend_each_other_end_in_a_diagnostic(project: Path) -> None:
    (project / "one.ljs").write_text("ljs 1\nuse .two\nmission one extends two {\n}\n")
    (project / "two.ljs").write_text("ljs 1\nuse .one\nmission two extends one {\n}\n")
    (project / "me.ljs").write_text("ljs 1\nuse .me\nmission me extends me {\n}\n")
    assert codes(compile_file(str(project / "one.ljs"))) == [("LJ0119", 2), ("LJ0119", 3)]
    assert codes(compile_file(str(project / "two.ljs"))) == [("LJ0119", 2), ("LJ0119", 3)]
    assert codes(compile_file(str(project / "me.ljs")))[0] == ("LJ0120", 2)


def _chain(project: Path, small: str, length: int) -> Path:
    """`mission_N`, which extends `mission_N-1`, and so on down to the small mission."""
    (project / "mission_0.ljs").write_text(small.replace("mission small", "mission mission_0"))
    for k in range(1, length + 1):
        text = f"ljs 1\nuse .mission_{k - 1}\nmission mission_{k} extends mission_{k - 1} {{ param more_{k} = {k} }}\n"
        (project / f"mission_{k}.ljs").write_text(text)
    return project / f"mission_{length}.ljs"


@pytest.fixture
def parsed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The parsed texts, in order, including repeated ones."""
    texts: list[str] = []
    run = Parser.run

    def counted(self: Parser, *slabs: Any) -> Any:
        texts.append(self.report.source.path)
        return run(self, *slabs)

    monkeypatch.setattr(Parser, "run", counted)
    return texts


def test_each_mission_of_a_chain_is_checked_once(project: Path, small: str, parsed: list[str]) -> None:
    compilation = compile_file(str(_chain(project, small, 8)))
    assert compilation.diagnostics == () and compilation.mission is not None
    assert [p.name for p in compilation.mission.parameters][-1] == "more_8"
    # each once as a library, once to be checked, and once in each mission that extends it
    assert max(parsed.count(path) for path in set(parsed)) <= 2 + 8


def test_a_chain_of_missions_has_a_maximum_length(project: Path, small: str) -> None:
    diagnostics = compile_file(str(_chain(project, small, 9))).diagnostics
    assert [item.code for item in diagnostics] == ["LJ0120"] and "more than 8 in a row" in diagnostics[0].message
    assert [item.code for item in compile_file(str(_chain(project, small, 60))).diagnostics] == ["LJ0119"] * 2


@pytest.mark.parametrize("faulty", [False, True])
def test_a_file_that_many_files_use_is_read_once(project: Path, parsed: list[str], *, faulty: bool) -> None:
    """Two files that both use two files, and so on: 2^20 paths lead to the last ones."""
    for k in range(21):
        uses = f"use .a{k - 1}\nuse .b{k - 1}\n" if k else "nonsense\n" if faulty else ""
        for name in "ab":
            (project / f"{name}{k}.ljs").write_text(f"ljs 1\n{uses}record {name}_{k} : other {{ place: position }}\n")
    diagnostics = compile_file(str(project / "a20.ljs")).diagnostics
    assert [item.code for item in diagnostics] == ["LJ0119", "LJ0119"] * faulty
    assert len(parsed) == 41  # all but `b20`


def test_a_chain_of_missions_has_a_maximum_total_length_of_text(
    project: Path, small: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(inherit, "LONGEST_TEXT", 2_000)
    diagnostics = compile_file(str(_chain(project, f"{small}{' ' * 2_000}", 2))).diagnostics
    assert [item.code for item in diagnostics] == ["LJ0119"] and "2,000 characters" in diagnostics[0].related[0].message


def test_only_files_inside_the_folder_of_the_mission_can_be_used(project: Path) -> None:
    (project / "boats").mkdir()
    (project / "boats" / "tug.ljs").write_text("ljs 1\nasset tug { engine = vessel }\n")
    (project / "main.ljs").write_text("ljs 1\nuse .boats.tug { tug }\nrecord a : other { }\n")
    assert compile_file(str(project / "main.ljs")).diagnostics == ()
    outside = project.parent / "outside.ljs"
    outside.write_text("ljs 1\nrecord b : other { }\n")
    (project / "link.ljs").symlink_to(outside)
    (project / "main.ljs").write_text("ljs 1\nuse .link\nrecord a : other { }\n")
    assert [item.code for item in compile_file(str(project / "main.ljs")).diagnostics] == ["LJ0118"]


HEAD = "use std.sea { person_in_water }\nuse .base { small }"


@pytest.mark.parametrize("head", ["victim", "victim[1..3] : person_in_water"])
def test_hidden_values_of_the_base_stay_hidden(project: Path, head: str) -> None:
    """A new value without `hidden` stays hidden."""
    override = f"  override target {head} {{ position ~ sites(search) }}"
    compilation = compiled(project, override, head=HEAD)
    assert compilation.diagnostics == () and compilation.mission is not None
    group = next(group for group in compilation.mission.groups if group.name == "victim")
    assert [prop.name for prop in group.properties if prop.hidden] == ["position"]
    compilation = compiled(project, override + '\n  override goal "They are at {victim[1].position}."', head=HEAD)
    assert ("LJ0401", 6) in codes(compilation)


TYPES = """
target box_of_secrets { engine = city
  hidden secret = 5 m }
target other_box : box_of_secrets { secret = 6 m }
"""


@pytest.mark.parametrize(
    "declared",
    [
        "kept : box_of_secrets { position = (1 m, 1 m) }",
        "kept : box_of_secrets { position = (1 m, 1 m), secret = 7 m }",
        "kept : box_of_secrets { position = (1 m, 1 m), state secret = 7 m }",
        "kept : other_box { position = (1 m, 1 m) }",
        "kept : other_box { position = (1 m, 1 m), secret = 8 m }",
    ],
)
def test_hidden_values_of_a_type_stay_hidden(project: Path, declared: str) -> None:
    """In an entity with another value, in a type that extends it, and in an entity of that type."""
    compilation = compiled(project, f"  target {declared}", head=f"use .base {{ small }}{TYPES}")
    assert compilation.diagnostics == () and compilation.mission is not None
    group = next(group for group in compilation.mission.groups if group.name == "kept")
    assert [prop.name for prop in group.properties if prop.hidden] == ["secret_m"]
