"""The languages of a mission's texts, and catalogues of the texts that the program itself writes for agents.

Concepts. The texts of a mission without a code are English. `goal zh "…"` and `prompt zh "…"` are the same texts in
another language, named by its ISO 639 code. A mission *has* a language if its goal and all its prompts have a text in
it. An episode is played in one language: its goal, its prompts, and the sentences around them, which the program writes
(`Phrases`). Names stay as they are in every language: ids, verbs, fields of JSON, reasons and details of receipts.

A *catalogue* is a JSON file beside the module that writes the texts, `phrases.zh.json`: the English text, with
placeholders, to its translation. So English needs none, and a text that no catalogue has stays English (ADR 0063).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

import msgspec

from lingjing.decoding import from_json
from lingjing.errors import Fault, UsageError
from lingjing.mission import model
from lingjing.patterns import pattern

ORIGINAL = "en"
"""The language of texts without a code."""

WRITTEN = ("en", "zh")
"""The languages of the sentences that the program itself writes. A mission may have others; its episodes cannot be
played in them."""

_CODE = pattern(r"[a-z]{2,3}")
"""Codes of ISO 639."""

_NONE: Mapping[str, str] = MappingProxyType({})


class Phrases:
    """The texts of one language. English texts with placeholders are their names.

    >>> Phrases("zh", {"{count} vans": "{count} 辆货车"})("{count} vans", count=3)
    '3 辆货车'
    """

    def __init__(self, language: str = ORIGINAL, catalogue: Mapping[str, str] = _NONE) -> None:
        self.language = language
        self._catalogue = catalogue

    def __call__(self, english: str, **values: object) -> str:
        """Return a text with its placeholders filled."""
        return self.text(english).format(**values)

    def text(self, english: str) -> str:
        """Return a text with its placeholders; the English one if the catalogue lacks it."""
        return self._catalogue.get(english, english)


@cache
def phrases(language: str, package: str) -> Phrases:
    """Return the texts that a package writes in a language; English if it has no catalogue of it."""
    if language == ORIGINAL:
        return Phrases()
    from importlib.resources import files  # takes 3 ms of a cold start

    file = files(package) / f"phrases.{language}.json"
    catalogue: Mapping[str, str] = from_json(file.read_bytes()) if file.is_file() else _NONE
    return Phrases(language, catalogue)


def is_code(text: str) -> bool:
    """Return whether a text has the form of a language's code."""
    return _CODE.fullmatch(text) is not None


def languages_of(mission: model.Mission) -> tuple[str, ...]:
    """Return the languages that the mission has, English first."""
    return (ORIGINAL, *(language for language in mission.goals if not _without(mission, language)))


def _without(mission: model.Mission, language: str) -> list[str]:
    """Return the agents with a prompt that has no text in a language: those of a mission that extends another one."""
    return [agent.name for agent in mission.agents if agent.prompt and language not in agent.prompts]


def in_language(mission: model.Mission, language: str) -> model.Mission:
    """Return the mission with its goal and its prompts in a language.

    Raises `UsageError` with a fault at `language` if the mission or the program lacks the language.
    """
    if language == ORIGINAL:
        return mission
    check_written(language)
    own = languages_of(mission)
    if language not in own:
        message = f"mission '{mission.name}' has no texts in '{language}'"
        if language in mission.goals:
            message += f" for the prompt of {', '.join(f'`{name}`' for name in _without(mission, language))}"
        raise _unknown(message, f'it has {", ".join(own)}; `goal {language} "…"` and prompts add it')
    agents = tuple(
        msgspec.structs.replace(agent, prompt=agent.prompts.get(language, agent.prompt)) for agent in mission.agents
    )
    return msgspec.structs.replace(mission, goal=mission.goals[language], agents=agents)


def check_written(language: str) -> None:
    """Raise `UsageError` with a fault at `language` for a language in which the program writes no sentences."""
    if language in WRITTEN:
        return
    short = re.split(r"[-_.]", language.strip().lower())[0]
    hint = f"did you mean `{short}`?" if short in WRITTEN else f"play in {' or '.join(WRITTEN)}"
    raise _unknown(f"rules and requests are written in {' and '.join(WRITTEN)} alone, and not in '{language}'", hint)


def _unknown(message: str, hint: str) -> UsageError:
    return UsageError(message, hint=hint, faults=(Fault("language", message, hint),))
