"""The origin of a mission's types and message records: libraries that it can `use`, or its own file.

A mission holds every type merged into its groups. To print it, each type is searched in the libraries. A library type
is used if it gives exactly the inherited properties, the engine and the verbs; other types are written out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import msgspec

from lingjing.dsl.checking import library
from lingjing.dsl.checking.bodies import reshaped
from lingjing.dsl.checking.scope import Library, RecordDecl, TypeDecl
from lingjing.dsl.checking.toplevel import load_library
from lingjing.mission import expression as ex
from lingjing.mission import model


@dataclass(slots=True)
class Imports:
    """The imports and local declarations of a mission's file."""

    uses: dict[str, list[str]] = field(default_factory=dict)
    """Library path → names, in the order of their first use."""
    types: list[model.Group] = field(default_factory=list)
    """Types without a library, each as a group with all that the type gives."""
    records: list[model.MessageKind] = field(default_factory=list)
    """Message records without a library."""
    verbs: dict[str, tuple[model.Verb, ...]] = field(default_factory=dict)
    """Type → all of its verbs."""


def find_imports(mission: model.Mission) -> Imports:
    """Find the imports and local declarations that a mission's file needs."""
    libraries = _libraries()
    imports = Imports()
    for name in dict.fromkeys(group.type for group in mission.groups):
        if name not in imports.verbs:
            _import_type(name, mission, libraries, imports)
    for kind in {message.type: message for message in mission.messages}.values():
        _import_record(kind, libraries, imports)
    return imports


def _libraries() -> dict[str, Library]:
    """Every library file without errors, by its path in a `use`."""
    libraries: dict[str, Library] = {}
    for path in library.known_paths("std"):
        paths = [path] if "." in path else library.known_paths(path)
        for dotted in paths:
            file = library.find_file(tuple(dotted.split(".")))
            if file is not None and dotted not in libraries:
                loaded, diagnostics = load_library(file)
                if not diagnostics:
                    libraries[dotted] = loaded
    return libraries


def _import_type(name: str, mission: model.Mission, libraries: dict[str, Library], imports: Imports) -> None:
    groups = [group for group in mission.groups if group.type == name]
    for path, declared in libraries.items():
        decl = declared.types.get(name)
        if decl is not None and all(_gives(decl, group) for group in groups):
            imports.uses.setdefault(path, []).append(name)
            imports.verbs[name] = tuple(decl.verbs.values())
            return
    _import_bases(groups[0], mission, libraries, imports)
    local = _put_together(groups, imports)
    imports.types.append(local)
    imports.verbs[name] = local.verbs


def _import_bases(group: model.Group, mission: model.Mission, libraries: dict[str, Library], imports: Imports) -> None:
    """Import the types that a local type extends, the farthest first: from groups, from a library, or as empty
    types."""
    names = {prop.name for prop in group.properties}
    for at, name in reversed(tuple(enumerate(group.bases))):
        above = group.bases[at + 1 :]
        if name in imports.verbs:
            continue
        if any(other.type == name for other in mission.groups):
            _import_type(name, mission, libraries, imports)
            continue
        for path, declared in libraries.items():
            decl = declared.types.get(name)
            if decl is not None and _extends(decl, group, above) and {p.name for p in decl.properties} <= names:
                imports.uses.setdefault(path, []).append(name)
                imports.verbs[name] = tuple(decl.verbs.values())
                break
        else:
            bare = model.Group(name=name, role=group.role, type=name, engine=group.engine, bases=above)
            imports.types.append(bare)
            imports.verbs[name] = imports.verbs[above[0]] if above else ()


def _extends(decl: TypeDecl, group: model.Group, above: tuple[str, ...]) -> bool:
    return (decl.role, decl.engine, decl.bases) == (group.role, group.engine, above)


def _gives(decl: TypeDecl, group: model.Group) -> bool:
    """True if the group can have been declared with this type."""
    if not _extends(decl, group, group.bases):
        return False
    own = {prop.name for prop in group.properties if not prop.inherited}
    anew = reshaped({prop.plain for prop in group.properties if not prop.inherited})
    if anew:
        own.add("look")
    due = [_shown(prop) for prop in decl.properties if prop.name not in own]
    inherited = [_shown(prop) for prop in group.properties if prop.inherited]
    if group.interactions != tuple(decl.interactions.values()) or group.mounts != tuple(decl.mounts.values()):
        return False
    if group.parts != (() if anew else tuple(decl.parts.values())):
        return False
    return due == inherited and all(_is_verb_of(verb, decl.verbs.get(verb.name)) for verb in group.verbs)


def _shown(prop: model.Property) -> model.Property:
    """The property without `hidden`, which an entity can add to an inherited one."""
    return msgspec.structs.replace(prop, hidden=False)


def _is_verb_of(verb: model.Verb, declared: model.Verb | None) -> bool:
    return declared is not None and (verb == declared or _bounded_as(declared, verb) == verb)


def _bounded_as(verb: model.Verb, other: model.Verb) -> model.Verb:
    """The verb with the other's bounds and default of the first argument, which is all that `actions` can change."""
    if not verb.arguments or not other.arguments:
        return verb
    own, bounded = verb.arguments[0], other.arguments[0]
    first = msgspec.structs.replace(
        own,
        minimum=bounded.minimum,
        maximum=bounded.maximum,
        default=bounded.default,
        optional=own.optional or bounded.default is not None,
    )
    return msgspec.structs.replace(verb, arguments=(first, *verb.arguments[1:]))


def _put_together(groups: list[model.Group], imports: Imports) -> model.Group:
    """A type that gives what these groups inherit."""
    first = groups[0]
    properties = _states(groups)
    properties |= {prop.name: prop for group in groups for prop in group.properties if prop.inherited}
    verbs = {verb.name: verb for verb in imports.verbs.get(first.bases[0] if first.bases else "", ())}
    for group in groups:
        for verb in map(_without_default, group.verbs):
            known = verbs.get(verb.name)
            verbs[verb.name] = verb if known is None else _wider(known, verb)
    return msgspec.structs.replace(first, properties=tuple(properties.values()), verbs=tuple(verbs.values()))


def _states(groups: list[model.Group]) -> dict[str, model.Property]:
    """The states, by name, to which these groups of one type give values of their own, as the type declares them.

    The type's value is not known if each group has its own. It has no effect then: the group's number stands for it, or
    0 for a value that is drawn or computed.
    """
    in_all = set.intersection(*({prop.name for prop in group.properties if prop.state} for group in groups))
    states = {}
    for prop in (prop for group in groups for prop in group.properties):
        if prop.name in in_all and not prop.inherited:
            value = prop.value if isinstance(prop.value, ex.Number) else ex.Number(0.0, prop.unit)
            states[prop.name] = msgspec.structs.replace(prop, value=value, hidden=False, inherited=True)
    return states


def _wider(a: model.Verb, b: model.Verb) -> model.Verb:
    """A verb that can be bounded to either of the two."""
    if not a.arguments or not b.arguments:
        return a
    first, other = a.arguments[0], b.arguments[0]
    low = _outer(first.minimum, other.minimum, min)
    high = _outer(first.maximum, other.maximum, max)
    return msgspec.structs.replace(
        a, arguments=(msgspec.structs.replace(first, minimum=low, maximum=high), *a.arguments[1:])
    )


def _outer(a: ex.Expr | None, b: ex.Expr | None, pick: Callable[..., float]) -> ex.Expr | None:
    if not isinstance(a, ex.Number) or not isinstance(b, ex.Number):
        return a if a == b else None
    return a if pick(a.value, b.value) == a.value else b


def _without_default(verb: model.Verb) -> model.Verb:
    """The verb as its type declares it. Only `actions` gives a default, which makes the argument optional."""
    if not verb.arguments or verb.arguments[0].default is None:
        return verb
    first = msgspec.structs.replace(verb.arguments[0], default=None, optional=False)
    return msgspec.structs.replace(verb, arguments=(first, *verb.arguments[1:]))


def _import_record(kind: model.MessageKind, libraries: dict[str, Library], imports: Imports) -> None:
    for path, declared in libraries.items():
        decl = declared.records.get(kind.type)
        if decl is not None and _same_record(decl, kind):
            imports.uses.setdefault(path, []).append(kind.type)
            return
    imports.records.append(kind)


def _same_record(decl: RecordDecl, kind: model.MessageKind) -> bool:
    return (decl.category, decl.fields) == (kind.category, kind.fields)
