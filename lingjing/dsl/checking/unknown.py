"""Names without a declaration: collected while a file is checked, reported at its end, one error for each name.

Only the whole file shows where the error is:

- Several uses of an unknown name and one declaration that resembles it, is of the needed kind and is never used: the
  declaration is misspelt, and the error is there.
- Names that one file of the standard library declares: its `use` is missing, and one error names them all.
- Otherwise the error is at the first use; the other uses are related places.
"""

from __future__ import annotations

import re

import msgspec

from lingjing.dsl.checking.scope import SymbolTables
from lingjing.dsl.checking.typenames import fits
from lingjing.dsl.source.reporter import Change, Reporter
from lingjing.dsl.syntax import tree as s
from lingjing.mission.diagnostics import Related, Span
from lingjing.mission.functions import ANY, NAME, Type
from lingjing.patterns import pattern
from lingjing.suggest import did_you_mean, nearest

_MOST_RELATED = 5
"""Most uses that an error lists (chosen)."""
_SYNTAX = ("LJ0010", "LJ0011", "LJ0006", "LJ0001")
"""Codes of syntax errors."""
_DECLARES_VALUES = ("param", "region", "grid", "target", "asset")
"""Keywords of declarations that expressions can refer to."""
_LOOKED_FOR_AS = {
    "agent": ("agent", "role"),
    "message": ("message kind",),
    "adjudicate": ("function",),
    "stage": ("stage",),
}
"""Keyword of a declaration → the kinds in `UnknownUse.what` that it can declare. The others declare values."""
_HEADS = {
    **{word: pattern(rf"{word} +\w") for word in ("message", "adjudicate", "stage", *_DECLARES_VALUES)},
    "agent": pattern(r"agent +\w+ *(\[[^\]]*\])? *as +(?!controls\b|when\b)\w"),
}
"""Keyword → pattern of a declaration with a complete name."""
_FROM_LIBRARIES = ("no asset type", "no target type", "no type", "no message record", "no interaction")
"""Kinds of names that libraries declare."""
_IN_LIBRARIES = (*_FROM_LIBRARIES, "no camera preset", "no weather")
"""Kinds of names that libraries declare, presets included."""
_DECLARED_BY = {
    "no role": "declare an agent with it: `agent … as {name} controls … {{ … }}`",
    "no agent": "declare it: `agent {name} as … controls … {{ … }}`",
    "no group and no message kind": "declare it: `target {name} : … {{ … }}`, or `message {name} : … from … to …`",
    "no message kind": "declare it: `message {name} : … from … to …`",
    "no stage": "declare it: `stage {name} {{ done when … }}`",
    "no region": "declare it: `region {name} = …`",
    "no param": "declare it: `param {name} = …`",
    "no inspection": "declare it: `inspection {name} of … by … {{ … }}`",
    "no limit": "declare it: `limit {name} <= … counts …`",
    "no function": "declare a rule: `adjudicate {name}(…) {{ when … }}`",
    "no entity, region or grid": "declare it: `region {name} = …`",
}
"""Kind of a missing name → the statement that declares it."""
_DECLARED_AS = {
    "quantity": "declare it: `param {name} = …`",
    "range": "declare it: `param {name} = …`",
    "region": "declare it: `region {name} = …`",
    "entity": "declare it: `target {name} : … {{ … }}`, or `asset`",
    "group": "declare it: `target {name}[1..…] : … {{ … }}`, or `asset`",
    "position": "declare it: `target {name} : … {{ … }}`, or `asset`",
}
"""Kind of the value that is due at a missing name → the statement that declares it."""


class UnknownUse(msgspec.Struct, frozen=True):
    """One use of an unknown name."""

    node: s.Name
    known: tuple[str, ...]
    """Names that are known there."""
    what: str
    """The kind of name that is missing, as the message begins: `nothing`, `no role`."""
    hint: str = ""
    """The way out if no known name is near."""
    replace: str | None = None
    """The text that a fix writes if no known name is near."""
    safe: bool = False
    """True if that text is certainly the intended one."""
    edits: tuple[Change, ...] = ()
    """A fix at another place if no known name is near."""


class UnknownNames:
    """The unknown names of one file."""

    def __init__(self, report: Reporter, scope: SymbolTables) -> None:
        self.report = report
        self.scope = scope
        self.uses: dict[str, list[UnknownUse]] = {}
        self.due: dict[int, Type] = {}
        """Offset of a use → the type of the value that is due there, where that is known."""

    def note(
        self,
        node: s.Name,
        known: list[str],
        what: str,
        hint: str = "",
        replace: str | None = None,
        *,
        safe: bool = False,
        edits: tuple[Change, ...] = (),
    ) -> None:
        """Store the use of a name without a declaration."""
        uses = self.uses.setdefault(node.text, [])
        if all(use.node.start != node.start for use in uses):  # some expressions are checked twice
            uses.append(UnknownUse(node, tuple(known), what, hint, replace, safe, edits))

    def needed(self, node: s.SyntaxNode, due: Type) -> None:
        """Store the type that is due where an unknown name stands."""
        if isinstance(node, s.Name) and due.kind != "any":
            self.due.setdefault(node.start, due)

    def report_all(self) -> None:
        """Report the stored uses."""
        faulty = self._faulty_declarations()
        reported = {
            name: sorted(uses, key=lambda use: use.node.start)
            for name, uses in self.uses.items()
            if name not in faulty and not self._was_in_a_fault(name)
        }
        self._forgotten_libraries(reported)
        for name, uses in reported.items():
            if self.report.full:
                break
            declared = self._misspelt_declaration(name, uses)
            if declared is not None:
                self._at_declaration(name, *declared, uses)
            else:
                self._at_first_use(name, uses)
        self.uses.clear()

    def _faulty_declarations(self) -> set[str]:
        """Names with a faulty declaration: it lacks its name, or has the name of another.

        For each such declaration this is the most used unknown name of its kind.
        """
        names: set[str] = set()
        for keyword in self._nameless():
            kinds = _LOOKED_FOR_AS.get(keyword, ("nothing", "group"))
            fitting = [
                (len(uses), name)
                for name, uses in self.uses.items()
                if name not in names and any(kind in uses[0].what for kind in kinds)
            ]
            if fitting:
                names.add(max(fitting)[1])
        return names

    def _nameless(self) -> list[str]:
        """The keywords of declarations with a missing or a duplicate name."""
        keywords = []
        source = self.report.source
        for item in self.report.diagnostics:
            line = source.line_text(item.span.line).strip()
            keyword = line.split(None, 1)[0] if line else ""
            if item.code == "LJ0104" and item.related:
                first = source.line_text(item.related[0].span.line).strip()
                if first != line and (keyword in _LOOKED_FOR_AS or keyword in _DECLARES_VALUES):
                    keywords.append(keyword)
            elif item.code in _SYNTAX and keyword in _HEADS and not _HEADS[keyword].match(line):
                keywords.append(keyword)
        return keywords

    def _was_in_a_fault(self, name: str) -> bool:
        """True if a faulty statement may have declared the name: as it is, joined with another word, or misspelt."""
        poisoned = self.scope.poisoned
        if name in poisoned or nearest(name, poisoned) is not None:
            return True
        return len(name) > 2 and any(word.startswith(name) or word.endswith(name) for word in poisoned)

    # -- a forgotten `use`

    def _forgotten_libraries(self, reported: dict[str, list[UnknownUse]]) -> None:
        """Report the names that a library declares, together, and remove them from `reported`."""
        by_library: dict[str, dict[str, list[UnknownUse]]] = {}
        for name, uses in reported.items():
            library = self._library_of(name, uses[0])
            if library:
                by_library.setdefault(library, {})[name] = uses
        for library, names in by_library.items():
            for name in names:
                del reported[name]
            if library.startswith("std."):
                self._forget_interactions(reported, library)
            if not (self.scope.incomplete and any(self._may_be_declared(uses[0]) for uses in names.values())):
                self._at_library(library, names)

    def _forget_interactions(self, reported: dict[str, list[UnknownUse]], library: str) -> None:
        """Remove the interactions of a library's types, which are missing with their types."""
        from lingjing.dsl.checking.shipped_names import performed_in

        for name in [name for name, uses in reported.items() if uses[0].what == "no interaction"]:
            if name in performed_in(library):
                del reported[name]

    def _library_of(self, name: str, use: UnknownUse) -> str:
        """The library that declares a name; empty for none. A near known name is likelier than a library."""
        library = self.scope.not_imported.get(name)
        if library is not None:
            return library
        if use.what not in _IN_LIBRARIES and not (use.what == "no type" or use.what == "nothing"):
            return ""
        from lingjing.dsl.checking.shipped_names import standard_names

        return standard_names().get(name, "")

    def _at_library(self, library: str, names: dict[str, list[UnknownUse]]) -> None:
        name, uses = min(names.items(), key=lambda item: item[1][0].node.start)
        node = uses[0].node
        places = [use.node for others in names.values() for use in others if use.node is not node]
        added = f"use {library} {{ {', '.join(sorted(names))} }}"
        self.report(
            "LJ0101", node.start, node.end, f"{uses[0].what} is called `{name}`", f"add it: `{added}`",
            related=self._related(places), edits=self._added_use(library, sorted(names)))  # fmt: skip

    def _added_use(self, library: str, names: list[str]) -> tuple[Change, ...]:
        """The edit that uses more names of a library: in the braces of its `use`, else as a line of its own."""
        text = self.report.source.text
        present = re.search(rf"^[ \t]*use +{re.escape(library)} *\{{(?P<names>[^}}\n]*)\}}", text, re.MULTILINE)
        if present is not None:
            at = present.start("names") + len(present["names"].rstrip(" ,"))
            listed = "".join(f", {name}" for name in names)
            return ((at, at, listed),)
        lines = list(re.finditer(r"^(?:ljs\b|use\b)[^\r\n]*(?:\r\n|\n|\r|$)", text, re.MULTILINE))
        at = lines[-1].end() if lines else 0
        return ((at, at, f"use {library} {{ {', '.join(names)} }}\n"),)

    # -- one name

    def _may_be_declared(self, use: UnknownUse) -> bool:
        """True if a part of the file that could not be read may have declared the name."""
        return use.node.text in self.scope.not_imported or use.what in _FROM_LIBRARIES

    def _at_first_use(self, name: str, uses: list[UnknownUse]) -> None:
        first = uses[0]
        if self.scope.incomplete and self._may_be_declared(first):
            return
        near = [nearest(name, self._fitting(use, uses)) for use in uses]
        close = near[0] if not first.safe else None
        replace = close if close is not None and all(other == close for other in near) else None
        hint = first.hint if close is None and first.hint else self._hint(name, uses, self._fitting(first, uses))
        self.report(
            "LJ0101", first.node.start, first.node.end, f"{first.what} is called `{name}`", hint,
            related=self._related([use.node for use in uses[1:]]),
            replace=replace if close is not None else first.replace,
            safe=close is None and first.safe,
            edits=first.edits if close is None else (),
            also=[(use.node.start, use.node.end) for use in uses[1:]] if replace or first.replace else ())  # fmt: skip

    def _fitting(self, use: UnknownUse, uses: list[UnknownUse]) -> list[str]:
        """The known names at a use with a type that fits all uses."""
        due = [self.due[each.node.start] for each in uses if each.node.start in self.due]
        symbols, words = self.scope.symbols, {*self.scope.known_names()} - self.scope.symbols.keys()

        def fitting(known: str) -> bool:
            kind = symbols[known].type if known in symbols else NAME if known in words else ANY
            return use.what != "nothing" or all(fits(kind, needed) for needed in due)

        return [known for known in use.known if fitting(known)]

    def _hint(self, name: str, uses: list[UnknownUse], known: list[str]) -> str:
        first = uses[0]
        if name in self.scope.rules and first.what == "nothing":
            bound = ", ".join(parameter.name.text for parameter in self.scope.rules[name].parameters)
            return f"`{name}` is a rule: write `{name}({bound})`"
        if nearest(name, known) is None:
            due = next((self.due[use.node.start] for use in uses if use.node.start in self.due), None)
            template = _DECLARED_BY.get(first.what) or (_DECLARED_AS.get(due.kind) if due is not None else None)
            if template is not None:
                listed = did_you_mean(name, known) if first.what != "nothing" else ""
                return template.format(name=name) + (f" ({listed})" if listed else "")
        return did_you_mean(name, known)

    def _related(self, nodes: list[s.Name]) -> tuple[Related, ...]:
        return tuple(
            Related(self.report.span(node.start, node.end), f"`{node.text}` is used here")
            for node in nodes[:_MOST_RELATED]
        )

    # -- a misspelt declaration

    def _at_declaration(self, name: str, declared: str, span: Span, uses: list[UnknownUse]) -> None:
        message = f"`{declared}` is declared, but `{name}` is what the rest of the file uses"
        related = self._related([use.node for use in uses])
        self.report.at("LJ0101", span, message, f"did you mean `{name}`?", related=related, replace=name)

    def _misspelt_declaration(self, name: str, uses: list[UnknownUse]) -> tuple[str, Span] | None:
        """The misspelt name and its place, if only a misspelt declaration explains the uses."""
        if len(uses) < 2:
            return None
        close = nearest(name, self._fitting(uses[0], uses))
        span = self._declaration(close, uses) if close else None
        if close is None or span is None or span.path != self.report.source.path:
            return None
        if any(self.report.span(use.node.start, use.node.end).line == span.line for use in uses):
            return None  # a declaration that uses the name is no declaration of it
        mentioned = len(re.findall(rf"(?<!\w){re.escape(close)}(?!\w)", self.report.source.text))
        return (close, span) if mentioned == 1 else None

    def _declaration(self, name: str, uses: list[UnknownUse]) -> Span | None:
        """The place where a name is declared as what all these uses need; None if it is declared as something else."""
        scope, what = self.scope, uses[0].what
        symbol = scope.symbols.get(name)
        if symbol is not None:
            due = [self.due[use.node.start] for use in uses if use.node.start in self.due]
            is_group = symbol.kind in ("group", "entity")
            of_kind = what == "nothing" or (is_group if "group" in what else symbol.kind in what)
            return symbol.span if of_kind and all(fits(symbol.type, kind) for kind in due) else None
        if what == "no function":
            return scope.rules[name].span if name in scope.rules else None
        if "type" in what:
            return scope.types[name].span if name in scope.types else None
        if "message kind" in what:
            return scope.messages[name][1] if name in scope.messages else None
        if what == "no stage":
            return scope.stages[name][1] if name in scope.stages else None
        if what in ("no role", "no agent"):
            return (scope.roles if what == "no role" else scope.agents).get(name)
        return None
