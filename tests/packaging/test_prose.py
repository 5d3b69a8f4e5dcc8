"""The check of the English in the code: what it counts, and how its limits behave."""

import importlib.util
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).parents[2] / "tools" / "prose.py"
_spec = importlib.util.spec_from_file_location("prose", TOOL)
assert _spec is not None and _spec.loader is not None
prose = importlib.util.module_from_spec(_spec)
sys.modules["prose"] = prose  # dataclasses look their module up
_spec.loader.exec_module(prose)

SAMPLE = '''"""Whether it holds."""

LIMIT = 3
"""Where it ends."""


def kept(path, found):
    """Return the paths that nobody reads."""
    for one in found:  # whoever writes it
        total = one


def question():
    """What is left? An empty list if the run has ended."""
'''


def test_each_habit_is_counted_with_its_line() -> None:
    counted = sorted((finding.line, finding.habit, finding.words) for finding in prose.findings(SAMPLE, Path("a.py")))
    assert counted == [
        (1, "headless", "Whether it holds."),
        (4, "headless", "Where it ends."),
        (7, "names", "found"),
        (8, "persons", "Return the paths that nobody reads."),
        (9, "names", "one"),
        (9, "persons", "whoever writes it"),
    ]


@pytest.mark.parametrize("text", ["The whole state.", "True if it holds.", "However large.", "What now?"])
def test_other_openings_are_accepted(text: str) -> None:
    assert list(prose.findings(f'"""{text}"""\n', Path("a.py"))) == []


def test_counts_above_a_limit_are_reported_and_an_update_raises_no_limit() -> None:
    limits = {"lingjing/dsl": {"headless": 2, "names": 1}}
    assert prose.above({"lingjing/dsl": {"headless": 2}}, limits) == []
    (message,) = prose.above({"lingjing/dsl": {"headless": 3}}, limits)
    assert message.startswith("prose: lingjing/dsl has 3 headless, and at most 2 are accepted")
    (message,) = prose.above({"tools": {"persons": 1}}, limits)
    assert "at most 0" in message
    assert prose.lowered({"lingjing/dsl": {"headless": 1, "names": 9}}, limits) == {
        "lingjing/dsl": {"headless": 1, "names": 1}
    }


def test_an_unknown_folder_is_an_error_of_the_arguments(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_:
        prose.main(["--list", "lingjing/nothing"])
    assert exit_.value.code == 2
    assert "there is no lingjing/nothing" in capsys.readouterr().err
