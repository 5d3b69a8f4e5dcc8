"""`mission night extends ssr { override … }`: a mission that starts from another mission's declarations.

The base is read into the same source, after the text of the extending mission. The statements of both are merged into
one list: the base's order, overriding statements in the place of the overridden ones, new ones at the end. So all later
phases see one mission. An error inside the base that an override causes is reported at the name of the base, with the
place in the base as a related place.
"""

from __future__ import annotations

import os
from collections.abc import Callable

import msgspec

from lingjing.dsl.checking.scope import MissionDecl
from lingjing.dsl.checking.toplevel import FileChecker, Files
from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.source.text import JoinedSource, read_source
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.parser import parse
from lingjing.dsl.syntax.statements import keyword_of
from lingjing.mission.diagnostics import Diagnostic, Related, in_source_order
from lingjing.suggest import did_you_mean, nearest

DEEPEST = 8
"""Most missions that extend each other in a row (chosen)."""

LONGEST_TEXT = 16 * 1024 * 1024
"""Most characters of a mission together with all that it extends (chosen)."""

Items = tuple[s.Statement, ...]
"""Statements of a mission."""
CheckFile = Callable[[s.File, Reporter, Files], object]
"""The function `checker.check`, passed as an argument because of the import order."""


def merge_base(
    file: FileChecker, node: s.MissionBlock, check: CheckFile, chain: tuple[str, ...] = ()
) -> s.MissionBlock | None:
    """Return the mission with its base's statements; None if the base is unusable, which is reported.

    `check` tests the base by itself.
    """
    if node.base is None:
        _nothing_to_override(file.report, node)
        return node
    base = _base(file, node.base, check, chain)
    if base is None:
        return None
    decl, block = base
    above = merge_base(file, block, check, (*chain, decl.path))
    if above is None:
        return None
    items = _merged(file.report, above.block.items, node)
    return msgspec.structs.replace(node, block=s.BracedBlock(node.block.start, node.block.end, items))


# -- private


def _base(
    file: FileChecker, name: s.Name, check: CheckFile, chain: tuple[str, ...]
) -> tuple[MissionDecl, s.MissionBlock] | None:
    decl = file.scope.missions.get(name.text)
    if decl is None:
        file.of.unknown_name(name, list(file.scope.missions), "no mission that this file uses")
        return None
    if decl.path in chain or len(chain) >= DEEPEST:
        why = "extends itself, through others" if decl.path in chain else f"is the end of more than {DEEPEST} in a row"
        file.report.at("LJ0120", name, f"`{name.text}` {why}")
        return None
    if not _is_good(file, name, decl, check):
        return None
    report = file.report
    source, part = report.source, read_source(decl.path)
    if len(source.text) + len(part.text) > LONGEST_TEXT:
        message = f"with `{name.text}` the mission has more than {LONGEST_TEXT:,} characters"
        report.at("LJ0120", name, message, "extend a shorter mission")
        return None
    joined = source if isinstance(source, JoinedSource) else JoinedSource(source, name.start, name.end)
    start = joined.append(part)
    report.source = joined
    tree = parse(report, start)
    file.declarations(tree, decl.path)
    block = next((item for item in tree.items if isinstance(item, s.MissionBlock)), None)
    return None if block is None else (decl, block)


def _is_good(file: FileChecker, name: s.Name, decl: MissionDecl, check: CheckFile) -> bool:
    """True if the base has no errors by itself. Only then is it merged. It need not be winnable."""
    report = file.report
    errors = _errors(file, decl.path, check)
    if errors is None:
        report.at("LJ0120", name, f"`{name.text}` extends itself, through others")
        return False
    if errors:
        report.at(
            "LJ0119",
            name,
            f"the mission `{name.text}` has errors",
            f"run `lingjing validate {decl.path}`",
            related=(Related(errors[0].span, errors[0].message),),
        )
    return not errors


def _errors(file: FileChecker, path: str, check: CheckFile) -> tuple[Diagnostic, ...] | None:
    """The errors of a file's mission; None if it is being checked now, so that it leads back to itself.

    Each file is checked once in a compilation, so a chain of missions costs no more than its members.
    """
    bases = file.files.bases
    bases.setdefault(file.chain[-1], None)
    key = os.path.realpath(path)
    if key not in bases:
        bases[key] = None
        report = Reporter(read_source(path))
        check(parse(report), report, file.files)
        bases[key] = tuple(item for item in in_source_order(tuple(report.diagnostics)) if item.severity == "error")
    return bases[key]


def _nothing_to_override(report: Reporter, node: s.MissionBlock) -> None:
    for item in node.block.items:
        if isinstance(item, s.Override):
            message = f"`{node.name.text}` extends no mission: there is nothing to override"
            end = item.start + len("override")
            report(
                "LJ0123", item.start, end, message, f"write `mission {node.name.text} extends … {{`, or drop the word"
            )


def _merged(report: Reporter, base: Items, node: s.MissionBlock) -> Items:
    base = tuple(item for item in base if not isinstance(item, s.ExpectBlock))  # tests of the base, which has its own
    base = _without_old_translations(base, node)
    places = {key: at for at, item in enumerate(base) if (key := _key(item)) is not None}
    items: list[s.Statement] = list(base)
    assert node.base is not None
    for item in node.block.items:
        if isinstance(item, s.Override):
            if isinstance(item.item, s.Faulty):
                continue  # its error is already reported
            at = places.get(_key(item.item) or ("", ""))
            if at is None:
                _no_such(report, item, list(places), node.base)
            else:
                items[at] = _overridden(items[at], item.item)
            continue
        key = _key(item)
        if key is not None and key in places:
            first = base[places[key]]
            word = " ".join(part for part in key if part)
            end = item.start + len(report.source.text[item.start : item.end].split(None, 1)[0])
            report(
                "LJ0124",
                item.start,
                end,
                f"`{node.base.text}` has `{word}` already",
                "write `override` before it",
                related=(Related(report.span(first.start, min(first.end, first.start + 40)), "declared here"),),
                replace=f"override {report.source.text[item.start : end]}",
            )
            continue
        items.append(item)
    return tuple(items)


def _without_old_translations(base: Items, node: s.MissionBlock) -> Items:
    """The base's items without the goal in other languages, if the mission has a goal of its own: they translate the
    base's. Those that the mission overrides stay."""
    overridden = {_key(item.item) for item in node.block.items if isinstance(item, s.Override)}
    if ("goal", "") not in overridden:
        return base
    return tuple(
        item for item in base if not isinstance(item, s.TextLine) or item.language is None or _key(item) in overridden
    )


def _no_such(report: Reporter, item: s.Override, known: list[tuple[str, str]], base: s.Name) -> None:
    key = _key(item.item)
    start, end = item.start, item.start + len("override")
    if key is None:
        report(
            "LJ0123",
            start,
            end,
            "this cannot be overridden",
            "only named declarations and single blocks can be overridden",
        )
        return
    names = [name for word, name in known if word == key[0] and name]
    hint = did_you_mean(key[1], names)
    close = nearest(key[1], names)
    name = getattr(item.item, "name", None)
    if isinstance(name, s.Name):
        start, end = name.start, name.end
    else:
        close = None
    word = " ".join(part for part in key if part)
    report("LJ0123", start, end, f"`{base.text}` has no `{word}` to override", hint, replace=close)


def _key(item: s.Statement) -> tuple[str, str] | None:
    """The identity of a declaration: its keyword and its name, or the names that it relates; None without identity."""
    if isinstance(item, s.TextLine):
        return item.keyword, item.language.text if item.language is not None else ""
    if isinstance(item, s.CapabilityLine | s.SettingsBlock | s.OutcomeLine):
        return item.keyword, ""
    if isinstance(item, s.SceneBlock):
        return "scene", ""
    if isinstance(item, s.ModeLine):
        return "mode", ""
    keyword, name = keyword_of(item), getattr(item, "name", None)
    if keyword is not None and isinstance(name, s.Name):
        return keyword, name.text
    if isinstance(item, s.OrderLine):
        return item.keyword, " ".join(name.text for name in item.stages)
    if isinstance(item, s.RelationLine):
        return "relation", f"{item.kind.text} {item.source.text} {item.target.text}"
    if isinstance(item, s.PermitLine):
        resource = _dotted(item.resource.source)
        return ("permit", resource) if resource else None
    return None


def _dotted(node: s.Expression) -> str:
    """Return the text of a path of names, such as `dog.forward`; "" for any other expression, which equals no other."""
    if isinstance(node, s.FieldExpr):
        return f"{_dotted(node.base)}.{node.name.text}"
    return node.text if isinstance(node, s.Name) else ""


def _overridden(old: s.Statement, new: s.Statement) -> s.Statement:
    """Merge an override. Settings and entities keep the lines that it does not name; all others are replaced."""
    if isinstance(old, s.SettingsBlock) and isinstance(new, s.SettingsBlock):
        block = _joined(old.block, new.block) or new.block
        return s.SettingsBlock(new.start, new.end, new.keyword, block, new.preset or old.preset)
    if isinstance(old, s.SceneBlock) and isinstance(new, s.SceneBlock) and old.kind.text == new.kind.text:
        return msgspec.structs.replace(new, block=_joined(old.block, new.block))
    if isinstance(old, s.EntityBlock) and isinstance(new, s.EntityBlock):
        new = msgspec.structs.replace(new, block=_hidden_as_before(old.block, new.block))
        if new.type is None:
            return msgspec.structs.replace(
                new,
                index=new.index or old.index,
                type=old.type,
                guard=new.guard or old.guard,
                block=_joined(old.block, new.block),
            )
    return new


def _hidden_as_before(old: s.BracedBlock | None, new: s.BracedBlock | None) -> s.BracedBlock | None:
    """The new lines, hidden where the old ones were: a new value must not reveal a hidden property."""
    if old is None or new is None:
        return new
    hidden = {_line(item) for item in old.items if isinstance(item, s.PropertyLine) and item.hidden}
    items = tuple(
        msgspec.structs.replace(item, hidden=True)
        if isinstance(item, s.PropertyLine) and _line(item) in hidden
        else item
        for item in new.items
    )
    return msgspec.structs.replace(new, items=items)


def _joined(old: s.BracedBlock | None, new: s.BracedBlock | None) -> s.BracedBlock | None:
    if old is None or new is None:
        return new or old
    overridden = {_line(item) for item in new.items} - {None}
    kept = [item for item in old.items if _line(item) not in overridden]
    return s.BracedBlock(new.start, new.end, (*kept, *new.items))


def _line(item: s.Statement) -> tuple[str, str] | None:
    if isinstance(item, s.PropertyLine):
        return "", item.name.text
    if isinstance(item, s.CameraBlock):
        return "camera", item.name.text
    if isinstance(item, s.SettingsBlock):
        return item.keyword, ""
    return None
