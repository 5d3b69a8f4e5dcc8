"""Checkers of texts for agents: goals and prompts with typed holes `{altitude}`, `{uav[i].position}`.

A hole names a param, a region, a grid, an entity, one of an entity's public properties, the mode or an index variable.
It is filled when the mission is instantiated (`lingjing.mission.wording`). Two braces stand for one.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from lingjing.dsl.checking.blocks import DeclarationChecker
from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.checking.values import STATIC, Environment
from lingjing.dsl.syntax import tree as s
from lingjing.mission.functions import Type
from lingjing.mission.languages import ORIGINAL, is_code
from lingjing.mission.wording import HOLE, PATH
from lingjing.suggest import did_you_mean, nearest

_SHOWN = frozenset(
    ("quantity", "text", "name", "flag", "position", "entity", "group", "region", "grid", "list", "range", "any")
)
"""Kinds of types that a hole can show."""


def is_original(node: s.TextLine, keyword: str) -> bool:
    """Return whether a text belongs to this keyword and has no code of a language."""
    return node.keyword == keyword and node.language is None


def _holes(text: str) -> set[str]:
    return {hole[1].strip() for hole in HOLE.finditer(text) if hole[1] is not None}


class WordingChecker(DeclarationChecker):
    """Checks the texts of one mission."""

    def text(self, node: s.TextLine, environment: Environment = STATIC) -> str:
        """Return a goal or a prompt. Reports holes that name nothing, have no textual form, or would reveal a hidden
        value.
        """
        raw = self.report.source.text[node.text.start : node.text.end]
        if "{" in raw or "}" in raw:
            for hole in HOLE.finditer(raw):
                if hole[1] is not None:
                    self._hole(node, hole, environment)
            self._lone_braces(node, raw)
        return node.text.value

    def translations(
        self, original: s.TextLine | None, nodes: Iterable[s.TextLine], environment: Environment = STATIC
    ) -> dict[str, str]:
        """Return a goal or a prompt in other languages, by their codes. Reports codes that are none, a language with
        two texts, and holes that differ from those of the original."""
        texts: dict[str, str] = {}
        for node in nodes:
            assert node.language is not None, "the original has no language"
            code = node.language.text
            if not is_code(code) or code == ORIGINAL:
                hint = f"codes have two or three small letters, such as `zh`; a text without one is `{ORIGINAL}`"
                self.report.at("LJ0127", node.language, f"`{code}` is no code of another language", hint)
            elif code in texts:
                self.report.at("LJ0103", node.language, f"the {node.keyword} in `{code}` is given twice", "remove one")
            elif original is None:
                hint = f'add `{node.keyword} "…"` in English'
                self.report.at("LJ0127", node.language, f"there is no {node.keyword} to translate", hint)
            elif original.text.value.strip() and not node.text.value.strip():
                hint = "write the whole text in it, or remove this line"
                self.report.at("LJ0127", node.text, f"the {node.keyword} in `{code}` is empty", hint)
            else:
                self._same_holes(original, node)
                texts[code] = self.text(node, environment)
        return texts

    # -- private

    def _same_holes(self, original: s.TextLine, node: s.TextLine) -> None:
        """Report the holes of a translation that differ from those of the original."""
        due, present = (_holes(line.text.value) for line in (original, node))
        if due != present:
            lacks, more = (
                ", ".join(f"`{{{hole}}}`" for hole in sorted(holes)) for holes in (due - present, present - due)
            )
            faults = [f"lacks {lacks}"] * bool(lacks) + [f"has {more} besides"] * bool(more)
            message = f"the {node.keyword} in `{node.language.text if node.language else ''}` {' and '.join(faults)}"
            self.report.at("LJ0127", node.text, message, "the texts of all languages have the same holes")

    def _lone_braces(self, node: s.TextLine, raw: str) -> None:
        """Report braces that neither begin nor end a hole. They are one error."""
        without = HOLE.sub(lambda hole: " " * len(hole[0]), raw)
        lone = [at for at, character in enumerate(without) if character in "{}"]
        if not lone:
            return
        brace, start = without[lone[0]], node.text.start
        message = f"this `{brace}` {'begins' if brace == '{' else 'ends'} no hole"
        hint = f"write `{brace}{brace}` for a brace; a hole is `{{name}}`"
        edits = tuple((start + at, start + at, without[at]) for at in lone)
        self.report("LJ0121", start + lone[0], start + lone[0] + 1, message, hint, edits=edits)

    def _hole(self, node: s.TextLine, hole: re.Match[str], environment: Environment) -> None:
        start, end = node.text.start + hole.start(), node.text.start + hole.end()
        match = PATH.fullmatch(hole[1])
        if match is None:
            hint = "a hole is `{name}`, `{name.field}` or `{name[1].field}`; write `{{` for a brace"
            self.report("LJ0121", start, end, f"`{hole[1].strip()}` is no name", hint)
            return
        name, index, field = match["name"], match["index"], match["field"]
        if name in environment.locals or name == "mode":
            return
        symbol = self.scope.symbols.get(name)
        if symbol is None:
            if name not in self.scope.poisoned:
                known = [*self.scope.symbols, *environment.locals]
                close = nearest(name, known)
                replace = None if close is None else "{" + hole[1].replace(name, close, 1) + "}"
                self.report(
                    "LJ0101", start, end, f"nothing is called `{name}`", did_you_mean(name, known), replace=replace
                )
            return
        if index and not index.isdigit() and index not in environment.locals:
            known = list(environment.locals)
            self.report("LJ0101", start, end, f"nothing is called `{index}`", did_you_mean(index, known))
            return
        place = s.Broken(start, end)
        if index is None and name in self.scope.groups:
            self.blocks.leak(self.scope.groups[name].count_taint, place, f"the {node.keyword}'s text")
        if field is None:
            self._shown(symbol.type, place)
            self.blocks.leak(symbol.taint, place, f"the {node.keyword}'s text")
            return
        self._field(node, name, field, place)

    def _field(self, node: s.TextLine, name: str, field: str, place: s.SyntaxNode) -> None:
        info = self.scope.groups.get(name)
        if info is None:
            kind = with_article(self.scope.symbols[name].type)
            self.report.at("LJ0102", place, f"`{name}` is {kind} and has no field `{field}`")
            return
        attribute = info.attributes.get(field)
        if attribute is None:
            hint = did_you_mean(field, info.attributes)
            self.report.at("LJ0102", place, f"`{name}` has no field `{field}`", hint)
            return
        self._shown(attribute.type, place)
        self.blocks.leak(attribute.taint, place, f"the {node.keyword}'s text")

    def _shown(self, kind: Type, place: s.SyntaxNode) -> None:
        if kind.kind not in _SHOWN:
            self.report.at("LJ0121", place, f"{with_article(kind)} cannot be put into words")
