"""`serial` and `parallel`: the dependencies that they become, their errors, and stages that count in order."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from lingjing.testing import Stage, compile_text, compiled, episode

TEXT = """ljs 2
use std.sea {{ lifeboat }}
mission yard "Yard" {{
  goal "Wait."
  scene bay {{ datum = sea level at -3.5 m }}
  clock {{ tick = 10 s, sync = 1 s }}
  budget {{ ticks <= 100 }}
  mode broadcast
  asset boat[1..2] : lifeboat {{ position = (10 m * i, -1350 m), heading = 30 deg }}
  agent skipper as rescuer controls boat[1], boat[2] {{ observes boat.*, events }}
  stage a {{ done when now >= 20 s }}
  stage b {{ done when true }}
  stage c {{ done when true }}
  stage d {{ done when now >= 10 s{more} }}
  stage m per u in boat {{ done when now >= 10 s * (3 - u.speed / 3 m/s) }}
  stage n per u in boat {{ done when true }}
  {orders}
  success when now > 900 s
}}
"""


def text(*orders: str, more: str = "") -> str:
    return TEXT.format(orders="\n  ".join(orders), more=more)


Printed = Callable[[str], tuple[object, object]]


def waits(source: str) -> set[tuple[str, str]]:
    relations = compiled(source).relations
    assert all(relation.kind == "dependency" for relation in relations)
    return {(relation.source, relation.target) for relation in relations if relation.serial}


@pytest.mark.parametrize(
    ("orders", "pairs"),
    [
        (("serial a, b, c",), {"ab", "bc"}),
        (("serial a, b", "serial b, c"), {"ab", "bc"}),
        (("serial a, b, d", "parallel b, c"), {"ab", "ac", "bd", "cd"}),
        (("parallel b, c", "serial a, b", "serial c, d"), {"ab", "ac", "bd", "cd"}),
        (("serial a, b", "parallel b, c", "parallel c, d"), {"ab", "ac", "ad"}),
        (("parallel b, c",), set()),
        (("relation dependency a -> b", "serial a, b"), {"ab"}),
    ],
)
def test_an_order_of_stages_becomes_dependencies(
    orders: tuple[str, ...], pairs: set[str], printed_again: Printed
) -> None:
    assert waits(text(*orders)) == {(pair[0], pair[1]) for pair in pairs}
    before, after = printed_again(text(*orders))
    assert before == after


def test_a_plain_dependency_stays_plain_when_parallel_stages_share_it(printed_again: Printed) -> None:
    mission = compiled(source := text("relation dependency a -> b", "parallel b, c", "serial c, d"))
    kinds = {(relation.source, relation.target): relation.serial for relation in mission.relations}
    assert kinds == {("a", "b"): False, ("a", "c"): False, ("c", "d"): True, ("b", "d"): True}
    before, after = printed_again(source)
    assert before == after


@pytest.mark.parametrize(
    ("orders", "code", "words"),
    [
        (("serial a",), "LJ0106", "two or more"),
        (("serial a, a",), "LJ0103", "given twice"),
        (("serial a, bb",), "LJ0101", "no stage"),
        (("serial a, b", "parallel a, b"), "LJ0606", "`b` waits for `a`"),
        (("serial a, b, c", "parallel a, c"), "LJ0606", "not parallel"),
        (("parallel a, skipper",), "LJ0101", "no stage"),
    ],
)
def test_a_wrong_order_is_an_error(orders: tuple[str, ...], code: str, words: str) -> None:
    errors = [item for item in compile_text(text(*orders)).diagnostics if item.severity == "error"]
    assert [item.code for item in errors] == [code] and words in errors[0].message


def test_a_cycle_of_serial_stages_is_reported_at_its_statement() -> None:
    source = text("serial a, b", "serial b, a")
    (item,) = [item for item in compile_text(source).diagnostics if item.code == "LJ0606"]
    assert item.severity == "warning" and source.splitlines()[item.span.line - 1].strip().startswith("serial")


def done(*orders: str, more: str = "", ticks: int = 6) -> tuple[dict[str, int], str]:
    """Each stage with its members → the tick at which it counted, and the reason of the end."""
    counted: dict[str, int] = {}
    with episode(compiled(text(*orders, more=more)), seed=1, stage=Stage()) as play:
        for tick in range(ticks + 1):
            if tick > 0 and not play.done:
                play.do({})
            for change in play.published.record.stages:
                counted.setdefault(change.stage + change.subject, change.tick)
        return counted, str(play.published.evaluation.reason)


def test_a_serial_stage_counts_after_the_previous_stage() -> None:
    free, _ = done()
    assert (free["a"], free["b"], free["d"], free["c"]) == (2, 0, 1, 0)
    counted, _ = done("serial a, b, d", "parallel b, c")
    assert (counted["a"], counted["b"], counted["c"], counted["d"]) == (2, 3, 3, 4)


def test_members_wait_for_their_own_stage() -> None:
    counted, _ = done("serial m, n")
    assert counted["mboat[1]"] == counted["mboat[2]"] == 2
    assert counted["nboat[1]"] == counted["nboat[2]"] == 3


def test_the_ticks_of_a_serial_stage_count_from_the_end_of_the_previous_stage() -> None:
    late = ", ticks <= 1"
    assert done("serial a, d", more=late)[1] == ""
    assert done("serial a, b, d", more=late.replace("1", "2"))[1] == ""
    never = text("serial a, d", more=late).replace("done when now >= 10 s, ", "done when not alive(boat[1]), ")
    with episode(compiled(never), seed=1, stage=Stage()) as play:
        while not play.done:
            play.do({})
        assert play.published.evaluation.reason == "late" and play.published.record.tick == 3
