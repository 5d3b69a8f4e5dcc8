"""`check_leaks`: hidden values that show or decide something which agents notice, and needless declassifications.

From version 2 of the language on, a mission states what agents may infer: `declassify end because "…"`. A text of
version 1 compiles with one warning, and its leaks count as declassified.
"""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax import tree as s
from lingjing.mission import model
from lingjing.mission.conditions import exposures
from lingjing.mission.conditions.leaks import END, Leak, declared_as_before, leaks
from lingjing.mission.diagnostics import has_errors
from lingjing.suggest import did_you_mean

DECLARED_SINCE = 2
"""The version of the language that introduced `declassify`."""

_NAMES = (
    f"remove it; a name is `{END}`, a command `asset.verb`, or the name of a constraint, a stage, a limit, an event or"
    " an interaction with a hidden value"
)


def check_leaks(mission: model.Mission, tree: s.File, report: Reporter) -> model.Mission:
    """Report the leaks of a mission that it does not declassify; the mission with those of version 1 declassified."""
    node = next((item for item in tree.items if isinstance(item, s.MissionBlock)), None)
    if node is None:
        return mission
    for exposure in exposures.exposures(mission):
        report("LJ0401", *_named(exposure.name, node), exposure.message, exposures.HINT)
    known = leaks(mission)
    declared = {item.what for item in mission.declassified}
    if not has_errors(tuple(report.diagnostics)):
        _report_needless(node, {END, *(leak.what for leak in known)}, report)
    missing = [leak for leak in known if leak.what not in declared]
    version = tree.items[0]
    if not missing:
        return mission
    if isinstance(version, s.Version) and _number(version) < DECLARED_SINCE:
        names = ", ".join(f"`{leak.what}`" for leak in missing)
        message = f"agents may infer hidden values from {names}; version {DECLARED_SINCE} requires a declaration"
        hint = "`lingjing fmt --upgrade` writes the declarations"
        report.at("LJ0405", version, message, hint, severity="warning")
        return declared_as_before(mission, known)
    for leak in missing:
        _report(leak, node, report)
    return mission


def _number(version: s.Version) -> float:
    return version.number.value if isinstance(version.number, s.NumberLiteral) else DECLARED_SINCE


def _report(leak: Leak, node: s.MissionBlock, report: Reporter) -> None:
    start, end = _place(leak, node)
    hint = f'write `declassify {leak.what} because "…"` if agents may know it, or use a condition without hidden values'
    report("LJ0404", start, end, leak.message, hint)


def _report_needless(node: s.MissionBlock, needed: set[str], report: Reporter) -> None:
    for item in _declassifications(node):
        for channel in item.what:
            what = declassified_name(channel)
            if what not in needed:
                message = f"no hidden value decides `{what}`, so there is nothing to declassify"
                hint = did_you_mean(what, sorted(needed)) or _NAMES
                report.at("LJ0406", channel, message, hint, severity="warning")


def declassified_name(channel: s.ObservedChannel) -> str:
    """Return the declassified item as it is written: `dog.forward`, `dog.*`, `fence` or `end`."""
    return _dotted(channel.source) + (".*" if channel.everything else "")


def _dotted(node: s.Expression) -> str:
    if isinstance(node, s.FieldExpr):
        return f"{_dotted(node.base)}.{node.name.text}"
    if isinstance(node, s.Subscript):
        index = node.index
        inside = f"{index.value:g}" if isinstance(index, s.NumberLiteral) else _dotted(index)
        return f"{_dotted(node.base)}[{inside}]"
    return node.text if isinstance(node, s.Name) else ""


def _declassifications(node: s.MissionBlock) -> Iterator[s.DeclassifyLine]:
    return (item for item in _items(node) if isinstance(item, s.DeclassifyLine))


def _items(node: s.MissionBlock) -> Iterator[s.Statement]:
    return (item.item if isinstance(item, s.Override) else item for item in node.block.items)


def _place(leak: Leak, node: s.MissionBlock) -> tuple[int, int]:
    """The place of the declaration of a leak; the name of the mission if it stands in a base."""
    for item in _items(node):
        if isinstance(item, s.OutcomeLine) and item.keyword == leak.at:
            return item.start, item.start + len(item.keyword)
        if isinstance(item, s.PermitLine) and leak.at == f"permit/{declassified_name(item.resource)}":
            return item.resource.start, item.resource.end
        if isinstance(item, s.ConstraintBlock) and leak.at == f"constraint/{item.name.text}":
            return item.name.start, item.name.end
        if isinstance(item, s.EventBlock) and leak.at.startswith(f"event/{item.name.text}/"):
            return item.name.start, item.name.end
        if isinstance(item, s.StageBlock) and leak.at == f"stage/{item.name.text}":
            return item.name.start, item.name.end
        if isinstance(item, s.UnlockLine) and leak.at == f"unlock/{item.name.text}":
            return item.name.start, item.name.end
    if leak.at.startswith("require/"):
        lines = [item for item in _items(node) if isinstance(item, s.RequireLine)]
        number = int(leak.at.removeprefix("require/"))
        if number <= len(lines) and node.base is None:
            return lines[number - 1].condition.start, lines[number - 1].condition.end
    return _head(node)


def _named(name: str, node: s.MissionBlock) -> tuple[int, int]:
    """The place of the declaration of this name; the name of the mission if it stands in a base."""
    for item in _items(node):
        if isinstance(item, s.EntityBlock | s.AgentBlock) and item.name.text == name:
            return item.name.start, item.name.end
    return _head(node)


def _head(node: s.MissionBlock) -> tuple[int, int]:
    head = node.base or node.name
    return head.start, head.end


__all__ = ["DECLARED_SINCE", "check_leaks", "declassified_name"]
