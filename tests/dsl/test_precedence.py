"""The operand of `not`: it includes a comparison to its right, and ends at its own brackets."""

from pathlib import Path

import pytest

from lingjing.testing import compile_text
from lingjing.testing.expressions import Binary, Unary

SSR = (Path(__file__).parents[2] / "scenarios" / "ssr.ljs").read_text("utf-8")
WON = "success when forall v in victim: rescued(v)"


@pytest.mark.parametrize(
    ("condition", "outer", "inner"),
    [
        ("not rescued(v) == true", Unary, Binary),
        ("(not rescued(v)) == true", Binary, Unary),
        ("((not rescued(v))) == true", Binary, Unary),
        ("not (rescued(v) == true)", Unary, Binary),
        ("(not rescued(v) == true)", Unary, Binary),
    ],
)
def test_the_operand_of_not_ends_at_its_own_brackets(condition, outer, inner):
    assert WON in SSR
    compiled = compile_text(SSR.replace(WON, f"success when forall v in victim: {condition}"))
    assert {item.code for item in compiled.diagnostics} <= {"LJ0510"}  # at the start, no victim is rescued
    body = compiled.mission.success.body
    assert type(body) is outer
    assert type(body.left if outer is Binary else body.operand) is inner
