"""Prompts: text files by name or by path, with holes such as `$goal` (`HOLES` lists them) for each agent.

`P0` is one line. `P1` adds the rules, a checklist for pictures, the coordinate frame, rules for decisions and the form
of an answer with its JSON Schema. `lingjing prompts improve` makes others. The agent's commands and messages follow
each prompt, because no prompt may change them. A shipped prompt has a text for each language (`P1.zh.txt`). The trace
holds a prompt's name and the SHA-256 of its English text.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from string import Template

from lingjing.plugins.languages import ORIGINAL
from lingjing.plugins.policy import Brief
from lingjing_agents.react.facts import goal_text, rules

SCHEMA_HOLE = "schema"
"""The hole of the JSON Schema of an answer. A prompt without it leaves the form of an answer to the model."""

HOLES = ("agent", "role", "goal", "task", "rules", "ticks", "tick_s", SCHEMA_HOLE)
LONGEST_BYTES = 64 * 1024
_FOLDER = files("lingjing_agents.react") / "prompts"


@dataclass(frozen=True, slots=True)
class PromptText:
    """A prompt with its holes: its name in the options, and its text."""

    name: str
    text: str

    @property
    def sha256(self) -> str:
        """SHA-256 (hex) of the text."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def has_schema(self) -> bool:
        """True if the prompt has the hole of the schema."""
        return SCHEMA_HOLE in Template(self.text).get_identifiers()

    def filled(self, brief: Brief, schema: str = "") -> str:
        """Return the text for one agent. `schema` is the JSON Schema of its answers."""
        values = {
            "agent": brief.agent,
            "role": brief.role,
            "goal": goal_text(brief),
            "task": brief.prompt,
            "rules": rules(brief),
            "ticks": f"{brief.ticks}",
            "tick_s": f"{brief.tick_s:g}",
            SCHEMA_HOLE: schema,
        }
        return Template(self.text).substitute(values).strip()


def shipped() -> tuple[str, ...]:
    """Return the names of the shipped prompts, without those of their texts in other languages (`P1.zh.txt`)."""
    return tuple(
        sorted(
            name
            for file in _FOLDER.iterdir()
            if file.name.endswith(".txt") and "." not in (name := file.name.removesuffix(".txt"))
        )
    )


def shipped_texts() -> dict[str, str]:
    """Return the texts of the shipped prompts by name."""
    return {name: (_FOLDER / f"{name}.txt").read_text(encoding="utf-8") for name in shipped()}


def check_text(text: str) -> None:
    """Raise `ValueError` for a text that is no prompt."""
    checked(PromptText("", text))


def prompt_text(name: str, language: str = ORIGINAL) -> PromptText:
    """Return a shipped prompt by its name, in a language, or the one in a file. Raises `ValueError` with its fault."""
    if name in shipped():
        file = f"{name}.txt" if language == ORIGINAL else f"{name}.{language}.txt"
        return checked(PromptText(name, (_FOLDER / file).read_text(encoding="utf-8")))
    try:
        data = Path(name).read_bytes()
    except OSError as error:
        known = ", ".join(shipped())
        raise ValueError(f"is no prompt ({known}) and no file that can be read: {error.strerror}") from error
    if len(data) > LONGEST_BYTES:
        raise ValueError(f"is a file of {len(data)} bytes; a prompt has at most {LONGEST_BYTES}")
    try:
        return checked(PromptText(name, data.decode("utf-8")))
    except UnicodeDecodeError as error:
        raise ValueError(f"is no UTF-8 text: {error}") from error


def checked(prompt: PromptText) -> PromptText:
    """Return the prompt. Raises `ValueError` for an empty one and for a hole that nothing fills."""
    if not prompt.text.strip():
        raise ValueError("is empty")
    if (size := len(prompt.text.encode("utf-8", "replace"))) > LONGEST_BYTES:
        raise ValueError(f"has {size:,} bytes; a prompt has at most {LONGEST_BYTES:,}")
    template = Template(prompt.text)
    if not template.is_valid():
        raise ValueError("has a `$` that begins no name; write `$$` for a dollar sign")
    strangers = sorted(set(template.get_identifiers()).difference(HOLES))
    if strangers:
        raise ValueError(f"has holes that nothing fills: {', '.join(strangers)}; known are {', '.join(HOLES)}")
    return prompt
