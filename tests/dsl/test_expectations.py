"""The block `expect`: its forms, its words that stay names elsewhere, its errors, and its printed text."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing import Mission
from lingjing.testing import compile_file, compile_text, instantiate, run_command

MISSION = """ljs 2
use std.sea { lifeboat, person_in_water }

mission m "M" {
  goal "Go."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 1 s }
  budget { ticks <= 60 }
  mode broadcast in { star, broadcast }
  param victims = 2 in 1..4
  param reach = 40 m in 20 m..60 m
  region search = box((-100 m, -1000 m), (300 m, -700 m))
  target victim[1..victims] : person_in_water { position ~ sites(search) }
  asset boat : lifeboat { position = (10 m, -1350 m) }
  agent skipper as rescuer controls boat { observes boat.*, events }
  comms { hub = skipper when mode == star }
  success when forall v in victim: emitted(rescue, v)
}
"""


def with_block(block: str) -> str:
    return MISSION.rstrip()[:-1] + f"  expect {{ {block} }}\n}}\n"


def expected(block: str) -> list[dict[str, object]]:
    """The expectations of a block as JSON values, without fields that have their defaults."""
    compilation = compile_text(with_block(block))
    assert compilation.mission is not None, compilation.diagnostics
    return stored(compilation.mission)


def stored(mission: Mission) -> list[dict[str, object]]:
    values: list[dict[str, object]] = msgspec.json.decode(msgspec.json.encode(mission.expectations))
    defaults = {"share": "all", "least": 0, "within": None, "episodes": FIVE}
    return [{name: value for name, value in each.items() if defaults.get(name, ...) != value} for each in values]


def first_error(block: str) -> tuple[str, str, str]:
    """Code, message and hint of the only error."""
    (diagnostic,) = compile_text(with_block(block)).diagnostics
    return diagnostic.code, diagnostic.message, diagnostic.hint


def seeds(first: int, last: int, mode: str = "", **settings: float) -> dict[str, object]:
    listed = [{"name": name, "value": number(value)} for name, value in settings.items()]
    return {"first_seed": first, "last_seed": last, "settings": listed, "mode": mode, "tier": 0}


def number(value: float, unit: str = "") -> dict[str, object]:
    return {"node": "Number", "value": value, "unit": unit}


def outcome(policy: str, word: str = "wins", **parts: object) -> dict[str, object]:
    return {"expects": "policy", "policy": policy, "outcome": word, **parts}


FIVE = seeds(0, 4)
FORMS: dict[str, dict[str, object]] = {
    "oracle wins": outcome("oracle"),
    "oracle wins all": outcome("oracle"),
    "heuristic wins some": outcome("heuristic", share="some"),
    "random loses none": outcome("random", "loses", share="none"),
    "oracle wins within 40 ticks": outcome("oracle", within=number(40.0, "ticks")),
    "oracle wins within 5 min": outcome("oracle", within=number(300.0, "min")),
    "oracle wins for seeds 3..5": outcome("oracle", episodes=seeds(3, 5)),
    "oracle loses for seeds 7": outcome("oracle", "loses", episodes=seeds(7, 7)),
    "oracle wins at least 3 of 8": outcome("oracle", share="at_least", least=3, episodes=seeds(0, 7)),
    '"./scout.py:Scout" wins with victims = 1, mode = star': outcome(
        "./scout.py:Scout", episodes=seeds(0, 4, "star", victims=1.0)
    ),
    "oracle wins for seeds 0..1 within 20 ticks some": outcome(
        "oracle", share="some", within=number(20.0, "ticks"), episodes=seeds(0, 1)
    ),
    "draws spread over search": {"expects": "spread", "region": "search", "episodes": seeds(0, 19)},
    "draws spread over search for seeds 0..9 with victims = 3": {
        "expects": "spread", "region": "search", "episodes": seeds(0, 9, victims=3.0)
    },
}  # fmt: skip


@pytest.mark.parametrize("text", FORMS)
def test_each_form_is_read_printed_and_stored(text: str, tmp_path: Path) -> None:
    assert expected(text) == [FORMS[text]]
    source, printed, document = (tmp_path / name for name in ("m.ljs", "printed.ljs", "m.json"))
    source.write_text(with_block(text))
    assert run_command(["compile", str(source), "--emit", "ljs", "-o", str(printed)]) == 0
    again = compile_file(str(printed)).mission
    assert again is not None and stored(again) == [FORMS[text]]
    assert run_command(["fmt", "--check", str(printed)]) == 0
    assert run_command(["compile", str(source), "-o", str(document)]) == 0
    assert stored(lingjing.compile(document)) == [FORMS[text]]


def test_a_condition_over_params_is_infeasible() -> None:
    (expectation,) = expected("infeasible when victims > 3")
    assert expectation["expects"] == "infeasible"
    assert expectation["condition"] == {
        "node": "Binary", "operator": ">", "left": {"node": "Ref", "name": "victims", "kind": "param"},
        "right": number(3.0),
    }  # fmt: skip


@pytest.mark.parametrize("comma", [", ", "\n", ",\n"])
def test_lines_and_commas_separate_expectations(comma: str) -> None:
    lines = [
        "oracle wins with victims = 2, mode = star",
        "random loses",
        '"a.py:B" wins',
        "infeasible when victims == 4",
    ]
    lines += ["draws spread over search for seeds 0..4", "oracle wins some for seeds 1"]
    results = expected(comma.join(lines))
    assert [each["expects"] for each in results] == ["policy", "policy", "policy", "infeasible", "spread", "policy"]
    assert results[0]["episodes"] == seeds(0, 4, "star", victims=2.0)


def test_a_semicolon_is_one_error_with_its_fix(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    block = "oracle wins within 40 ticks; random loses; infeasible when victims == 4;"
    diagnostics = compile_text(with_block(block)).diagnostics
    assert [item.code for item in diagnostics] == ["LJ0001"] * 3 and all(item.fix for item in diagnostics)
    file = tmp_path / "m.ljs"
    file.write_text(with_block(block))
    assert run_command(["validate", "--fix", str(file)]) == 0
    capsys.readouterr()
    assert len(compile_text(file.read_text()).mission.expectations) == 3  # type: ignore[union-attr]


def test_words_of_expectations_are_names_elsewhere() -> None:
    words = ("wins", "loses", "spread", "some", "none", "all", "seeds", "within", "with", "least", "draws", "expect")
    lines = "\n".join(f"  param {word} = 1 in 0..3" for word in words)
    text = MISSION.replace("  region", f"{lines}\n  region", 1)
    text = text.replace("(10 m, -1350 m)", f"(1 m * ({' + '.join(words)}), -1350 m)")
    compilation = compile_text(text)
    assert compilation.mission is not None, compilation.diagnostics
    names = [parameter.name for parameter in compilation.mission.parameters]
    assert set(words) <= set(names)
    settings = ", ".join(f"{word} = 2" for word in words)
    again = compile_text(text.rstrip()[:-1] + f"  expect {{ oracle wins with {settings} }}\n}}\n")
    assert again.mission is not None, again.diagnostics
    assert stored(again.mission) == [outcome("oracle", episodes=seeds(0, 4, **dict.fromkeys(words, 2.0)))]


def test_words_of_expectations_are_names_of_policies() -> None:
    results = expected("all wins, with loses, seeds wins some")
    assert [each["policy"] for each in results] == ["all", "with", "seeds"]


@pytest.mark.parametrize(
    ("block", "code", "message", "hint"),
    [
        ("oracle wins within 40", "LJ0203", "the bound of an expectation is a number of ticks, or a time",
         "write `within 40 ticks`"),
        ("oracle wins within 0 ticks", "LJ0206", "the bound of an expectation is above 0", ""),
        ("oracle wins for seeds 4..0", "LJ0206", "the range of seeds runs backwards", "write `for seeds 0..4`"),
        ("oracle wins for seeds 0.5", "LJ0206", "a seed is a whole number from 0", "write `for seeds 0..4`"),
        ("oracle wins for seeds 0..9999", "LJ0206", "an expectation has at most 1000 seeds", ""),
        ("oracle wins at least 6 of 5", "LJ0206", "no such number of the seeds is possible",
         "write `at least 3 of 5`, with numbers from 1 to 1000"),
        ("oracle wins at least 3 of 5 for seeds 0..3", "LJ0206",
         "`for seeds` has 4 seeds, and `of 5` has another number", "write `of 4`"),
        ("oracle wins some all", "LJ0103", "this part of the expectation is given twice", "remove one of the two"),
        ("oracle wins some at least 1 of 2", "LJ0103", "two shares of the seeds are given", "remove one of the two"),
        ("oracle wins with victms = 2", "LJ0101", "no param is called `victms`", "did you mean `victims`?"),
        ("oracle wins with victims = 9", "LJ0206", "9 is outside of the bounds of `victims`", ""),
        ("oracle wins with reach = 50", "LJ0203", "`reach` is a length, this is a bare number", ""),
        ("oracle wins with mode = single", "LJ0109", "the mission has no mode `single`", "known: broadcast, star"),
        ("oracle wins with victims = 2, victims = 3", "LJ0103", "`victims` is set twice", ""),
        ("draws spread over serach", "LJ0101", "no region is called `serach`", "did you mean `search`?"),
        ("draws spread over search within 4 ticks", "LJ0107", "`draws` has seeds and settings alone", "remove it"),
        ("draws spread over search some", "LJ0107", "`draws` has seeds and settings alone", "remove it"),
        ("oracle", "LJ0108", "`expect` lacks the outcome of `oracle`", "write `oracle wins` or `oracle loses`"),
        ("oracle win", "LJ0010", "`win` does not fit here", "did you mean `wins`?"),
        ('"" wins', "LJ0206", "the name of the policy is empty", ""),
        ("infeasible victims == 4", "LJ0010", "`when` is due here in `infeasible`, found `victims`", "write `when`"),
        ('goal "x"', "LJ0107", "`goal` has no meaning in `expect`", "it stands in a mission"),
    ],
)  # fmt: skip
def test_a_faulty_expectation_gives_exactly_one_error_with_its_hint(
    block: str, code: str, message: str, hint: str
) -> None:
    assert first_error(block) == (code, message, hint)


def test_an_expectation_outside_of_its_block_is_an_error() -> None:
    (diagnostic,) = compile_text(MISSION.rstrip()[:-1] + "  oracle wins\n}\n").diagnostics
    assert (diagnostic.code, diagnostic.hint) == ("LJ0107", "it stands in `expect`")


def test_each_faulty_expectation_is_reported_at_its_line() -> None:
    diagnostics = compile_text(with_block("oracle wins wthin 3 ticks\nrandom loses with x = 1\n")).diagnostics
    assert [item.span.line for item in diagnostics] == [18, 19]


def test_a_derived_mission_does_not_inherit_expectations(tmp_path: Path) -> None:
    (tmp_path / "base.ljs").write_text(with_block("oracle wins"))
    derived = tmp_path / "derived.ljs"
    derived.write_text('ljs 2\nuse .base { m }\nmission d extends m "D" { override budget { ticks <= 30 } }\n')
    compilation = compile_file(str(derived))
    assert compilation.mission is not None and compilation.mission.expectations == ()


def test_instances_do_not_depend_on_expectations() -> None:
    def made(text: str) -> object:
        mission: Mission | None = compile_text(text).mission
        assert mission is not None
        return instantiate(mission, seed=3)

    assert made(MISSION) == made(with_block("oracle wins, draws spread over search"))


def test_a_mission_page_shows_the_expectations(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "m.ljs"
    file.write_text(with_block("oracle wins within 40 ticks, random loses"))
    assert run_command(["docs", str(file)]) == 0
    assert "oracle wins within 40 ticks\n" in capsys.readouterr().out
