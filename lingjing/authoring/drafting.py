"""`Drafting`: from a sentence to a mission that validates and meets its own expectations, with a chat model.

The model receives the language's card and the sentence. Each answer is compiled, then its expectations are run; the
errors, or what happened in the episodes, are the next message. The conversation ends when everything holds, after the
last round, or when the money is spent.

An answer is a stranger's text: its expectations may name only policies that play without files and without models, few
seeds and short episodes, so that a round is bounded.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import msgspec

from lingjing.authoring.checks import checks_of
from lingjing.authoring.running import CheckResult, CheckRunner
from lingjing.dsl.compilation import compile_text
from lingjing.dsl.diagnostics.render import render_text
from lingjing.dsl.pages.card import language_card
from lingjing.dsl.pages.gbnf import gbnf
from lingjing.mission import model
from lingjing.mission.diagnostics import Diagnostic
from lingjing.mission.instantiate import instantiate
from lingjing.plugins.backbone import ChatMessage
from lingjing.plugins.writers import MissionWriter, WrittenAnswer

POLICIES = ("oracle", "heuristic", "random", "idle")
"""The policies that expectations of a draft may name."""
MOST_SEEDS = 10
"""Most seeds of one expectation of a draft (chosen)."""
MOST_CHECKS = 12
"""Most expectations of a draft (chosen)."""
MOST_TICKS = 300
"""Most ticks of an episode of a draft (chosen)."""
MOST_ENTITIES = 60
"""Most entities of a draft (chosen)."""
_MOST_DIAGNOSTICS = 12
"""Most errors in one message (chosen): later ones often follow from earlier ones."""
_MOST_LETTERS = 6000
"""Most letters of one message to the model after the first (chosen)."""
_FENCE = re.compile(r"^[ \t]*(?:```|~~~)[\w.-]*[ \t]*\n(.*?)(?:^[ \t]*(?:```|~~~)[ \t]*$|\Z)", re.MULTILINE | re.DOTALL)
_BEGINNING = re.compile(r"^(?:ljs \d|use [\w.]+|(?:asset|target|mission|record|weather|camera) \w+.*\{)", re.MULTILINE)

INSTRUCTIONS = f"""\
You write missions in the language .ljs, which the card below describes. You receive the description of a mission in \
a sentence. Answer with the whole text of one file in one fenced block, and with nothing else.

The file holds one mission. Use types, messages and weather of the standard library where they fit. Keep it small: at \
most {MOST_ENTITIES} entities and {MOST_TICKS} ticks, places within the scene. State with a block `expect` that it can \
be won and does not win itself, for example:

  expect {{
    oracle wins within 40 ticks for seeds 0..2
    idle loses for seeds 0..1
    draws spread over search
  }}

`oracle` knows everything, `idle` does nothing, `random` acts at random, `heuristic` follows simple rules; no other \
policy may be named, and at most {MOST_SEEDS} seeds. Bounds must leave the oracle time: a car drives some 5 m/s with \
its detours, a quadrotor 8 m/s, a robot dog 0.7 m/s, a lifeboat 2 m/s. You then receive the errors of the compiler, or \
what happened in the episodes, and answer with the whole corrected file.
"""


class DraftRound(msgspec.Struct, frozen=True, kw_only=True):
    """One answer of the model and its result."""

    number: int
    """Counted from 1."""
    text: str
    """The mission's text in the answer; "" for none."""
    problem: str
    """The message to the model; "" if everything holds."""
    summary: str
    """The result in one line."""


class Draft(msgspec.Struct, frozen=True, kw_only=True):
    """The result of a conversation."""

    rounds: tuple[DraftRound, ...]
    """All rounds; at least one."""

    @property
    def is_certified(self) -> bool:
        """True if the last text validates and meets its expectations."""
        return not self.rounds[-1].problem

    @property
    def text(self) -> str:
        """The last text of a mission; "" if no answer had any."""
        return next((each.text for each in reversed(self.rounds) if each.text), "")


def prompt(sentence: str) -> tuple[ChatMessage, ...]:
    """The beginning of the conversation."""
    return (
        ChatMessage("system", f"{INSTRUCTIONS}\n{language_card()}"),
        ChatMessage("user", f"Write this mission: {sentence}"),
    )


def draft(
    sentence: str, writer: MissionWriter, rounds: int, runner: CheckRunner, tell: Callable[[DraftRound], None]
) -> Draft:
    """Hold the conversation, at most `rounds` answers. `tell` receives each round.

    Raises `InfrastructureError` if the service does not answer or an episode is aborted, and its subclass
    `SpendingLimitError` if the money is spent.
    """
    conversation = prompt(sentence)
    grammar = gbnf()
    held: list[DraftRound] = []
    for number in range(1, rounds + 1):
        answer = writer.write(conversation, grammar)
        this = _round(number, answer, runner)
        held.append(this)
        tell(this)
        if not this.problem:
            break
        # Only the last answer and its problems stay: the conversation does not outgrow the model's context.
        shown = ChatMessage("assistant", answer.text[: 4 * _MOST_LETTERS] or "(empty)")
        conversation = (*conversation[:2], shown, ChatMessage("user", _shortened(this.problem)))
    return Draft(rounds=tuple(held))


def mission_text(answer: str) -> str:
    """The text of a mission in an answer: the longest fenced block, or else everything from the first statement on."""
    blocks: list[str] = [block for block in _FENCE.findall(answer) if block.strip()]
    if blocks:
        return max(blocks, key=len).strip() + "\n"
    begin = _BEGINNING.search(answer)
    return answer[begin.start() :].strip() + "\n" if begin is not None else ""


# -- private


def _round(number: int, answer: WrittenAnswer, runner: CheckRunner) -> DraftRound:
    text = mission_text(answer.text)
    problem, summary = _problem(text, answer, runner, number)
    return DraftRound(number=number, text=text, problem=problem, summary=summary)


def _problem(text: str, answer: WrittenAnswer, runner: CheckRunner, number: int) -> tuple[str, str]:
    """The message to the model about a text, and one line for the user; ("", …) if everything holds."""
    cut = "\nYour answer was cut off: write a shorter file." if answer.is_cut else ""
    if not text:
        return f"Your answer holds no mission. Answer with the whole file in one fenced block.{cut}", "no mission"
    compilation = compile_text(text, path="mission.ljs")
    errors = [item for item in compilation.diagnostics if item.severity == "error"]
    mission = compilation.mission
    if errors or mission is None:
        shown = render_text(errors[:_MOST_DIAGNOSTICS], compilation.source) or "the file holds no mission"
        return (
            f"The file has errors ({len(errors)}):\n\n{shown}{cut}",
            f"errors ({len(errors)}), first: {_first(errors)}",
        )
    refused = _refused(mission)
    if refused:
        return refused, refused.splitlines()[0]
    path = runner.folder / f"draft-{number}" / f"{mission.name}.ljs"
    path.parent.mkdir()
    path.write_text(text, encoding="utf-8")
    results = [runner.run(check) for check in checks_of(path.name, path, mission)]
    failed = [result for result in results if result.state != "passed"]
    if not failed:
        return "", f"valid, {len(results)} expectations hold"
    lines = [line for result in failed for line in _failed(result)]
    return "The file is valid, but expectations fail:\n\n" + "\n".join(
        lines
    ), f"{len(failed)} of {len(results)} expectations fail"


def _refused(mission: model.Mission) -> str:
    """The reason why the mission's expectations are not run; "" if they are."""
    expectations = mission.expectations
    played = [each for each in expectations if isinstance(each, model.PolicyExpectation)]
    if not any(each.policy == "oracle" and each.outcome == "wins" for each in played):
        return "The mission lacks an expectation that it can be won: add `expect { oracle wins for seeds 0..2 }`."
    if len(expectations) > MOST_CHECKS:
        return f"The mission has {len(expectations)} expectations; at most {MOST_CHECKS} are run."
    for each in played:
        if each.policy not in POLICIES:
            return f"The expectation of `{each.policy}` cannot be run: only {', '.join(POLICIES)} may be named."
        if len(each.episodes.seeds) > MOST_SEEDS:
            return f"An expectation has {len(each.episodes.seeds)} seeds; at most {MOST_SEEDS} are run."
    instance = instantiate(mission)
    if instance.budget.ticks > MOST_TICKS:
        return f"An episode may have {instance.budget.ticks} ticks; at most {MOST_TICKS} are played: use longer ticks."
    if len(instance.entities) > MOST_ENTITIES:
        return f"The mission has {len(instance.entities)} entities; at most {MOST_ENTITIES} are played."
    return ""


def _failed(result: CheckResult) -> list[str]:
    details = [line for line in result.details if "lingjing " not in line]
    return [f"{result.check.text}", f"  {result.state}: {result.summary}", *(f"  {line}" for line in details)]


def _first(errors: list[Diagnostic]) -> str:
    return errors[0].message if errors else "the file holds no mission"


def _shortened(problem: str) -> str:
    return problem if len(problem) <= _MOST_LETTERS else problem[:_MOST_LETTERS] + "\n…"


def draft_file(mission_file: Path) -> Path:
    """The place of a text that does not hold, beside the place of the mission."""
    return mission_file.with_suffix(".draft.ljs")
