"""Tests that a step is read from an answer with other text around it."""

import json

import pytest
from lingjing_agents.react.answer import StepError, after_reasoning, read_step, step_text
from lingjing_agents.react.step import StepFormat

from agents.tests.agent_kit import brief

FORM = StepFormat(brief(), memory=True, crops=True)

EAST = '{"thought": "east", "command": null, "messages": []}'
WEST = '{"thought": "west", "command": null, "messages": []}'


@pytest.mark.parametrize(
    "text",
    [
        EAST,
        f"```json\n{EAST}\n```",
        f"Of the places {{a, b}} I take b: {EAST} (and so on}})",
        f"f(x) = {{x + 1}}; {EAST}",
        f'{{"a": 1}} is no step. {EAST}',
        f"{EAST}\n{EAST}",
        f"{EAST} {{}} {{",
        f"<think>first {WEST}, then {{x}}</think>{EAST}",
        f"<think>\n{WEST}\n</think>\n\n```json\n{EAST}\n```",
        f"{WEST} or not {WEST}?\n</think>\n{EAST}",
        f"<THINKING>{WEST}</THINKING>{EAST}",
        f"<think>a</think>{WEST}<think>no</think>{EAST}",
        f"[THINK]{WEST}[/THINK]{EAST}",
        f"<seed:think>{WEST}</seed:think>{EAST}",
        f"<|channel|>analysis<|message|>{WEST}<|end|><|start|>assistant<|channel|>final<|message|>{EAST}",
        EAST.replace("east", "after </think> comes {the} answer"),
        EAST.replace("east", "<think> is a tag"),
    ],
)
def test_the_step_is_separated_from_the_text_around_it(text: str):
    thought = read_step(text, FORM).decision.thought
    assert thought
    assert "west" not in thought


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no JSON object"),
        ("nothing", "no JSON object"),
        (f"{EAST} or rather {WEST}", "2 different steps"),
        (f"<think>{EAST}", "reasoning does not end"),
        (f"<think>{EAST}</think> Done.", "no JSON object"),
        ('{"a": 1}', "none of the fields"),
        ("{}", "none of the fields"),
        ('{"thought": "x", ', "does not end"),
        ('{"thought": "x', "does not end"),
        ("{'thought': 'x'}", "no JSON object"),
        ('{"thought": "x",}', "malformed"),
        ('{"thought": "x", "command": NaN}', "not a step"),
        ('{"thought": ' + "9" * 5000 + "}", "not a step"),
        ('{"thought": ' + '{"a":' * 100_000, "nested too deeply"),
        ('{"messages": ' + "[" * 3000 + "]" * 3000 + "}", "nested too deeply"),
        ('{"messages": ' + "[" * 900 + "]" * 900 + "}", "not a step"),
    ],
)
def test_an_answer_without_a_valid_step_is_reported(text: str, says: str):
    with pytest.raises(StepError, match=says):
        read_step(text, FORM)


@pytest.mark.parametrize("piece", ["{", '{"', '{"a":', '{"a":1} ', "{ ", '{"thought":"', "\\{", "<think>", "</think>"])
def test_an_answer_of_a_million_braces_is_searched_in_linear_time(piece: str):
    """Under the suite's time limit: a search that grows with the square of the text would take hours."""
    with pytest.raises(StepError):
        step_text(piece * (2_000_000 // len(piece)))


def test_reasoning_is_removed_from_an_answer_that_the_model_receives_again():
    assert after_reasoning(f"<think>{WEST}</think>{EAST}") == EAST
    assert json.loads(after_reasoning(EAST))
