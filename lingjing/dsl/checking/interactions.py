"""Checks of interactions: who performs them, and what they move between which states.

`by` names an engine or a role. A role is known to the types of the file whose mission's agents play it.

`type` looks at one target type by itself, once every type of the file is known; `between` at a mission's target and the
assets that may act on it. What is moved must be declared as a state at both ends, and measured in one dimension.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

import msgspec

from lingjing.dsl.checking.blocks import BlockReader
from lingjing.dsl.checking.keys import PropertyEntry
from lingjing.dsl.checking.scope import GroupInfo, PropertyType, SymbolTables, TypeDecl
from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.source.suggest import did_you_mean, nearest
from lingjing.dsl.syntax import tree as s
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.kinds import builtin_engines

_WORDS = {name: name for name in ("by", "status", "takes", "gives", "up_to", "told")} | {"source": "from"}
"""The names that an interaction is made of → the author's words for them."""

_Words = dict[str, s.PropertyLine]


UNSAID = ex.Number(value=0.0)
"""The radius of an interaction whose type has said none yet; a declared one is more than nothing."""


def declared(name: str, entries: dict[str, PropertyEntry], base: model.Interaction | None) -> model.Interaction:
    """What an interaction's block says, over what the base type's interaction of that name says."""
    old = base or model.Interaction(name=name, by="", within=UNSAID)
    words = {to: _word(entries, key) for to, key in _WORDS.items() if key in entries}
    values = {key: entries[key].value.ir for key in ("within", "lasting", "aboard") if key in entries}
    return msgspec.structs.replace(old, **words, **values)


class InteractionChecker:
    """The interactions of a file's target types, and of a mission's targets."""

    def __init__(self, blocks: BlockReader) -> None:
        self.report = blocks.report
        self.scope: SymbolTables = blocks.of.scope
        self._roles: Collection[str] = ()

    def type(self, decl: TypeDecl, nodes: Iterable[s.InteractionBlock], roles: Collection[str]) -> None:
        """Check what a type of this file says of its interactions; `roles` are those of the file's missions."""
        self._roles = roles
        for node in nodes:
            one = decl.interactions.get(node.name.text)
            if one is not None and not any(isinstance(item, s.Faulty) for item in node.block.items):
                self._type(decl, one, node)

    def between(self, node: s.EntityBlock, target: GroupInfo, agents: Iterable[model.Agent]) -> None:
        """Check that somebody in the mission has what the interactions of a target move."""
        if target.type is None or node.type is None or self.scope.incomplete:
            return
        played: dict[str, set[str]] = {}
        for agent in agents:
            named = {part.name for expr in agent.controls for part in ex.parts(expr) if isinstance(part, ex.Ref)}
            played.setdefault(agent.role, set()).update(named)
        for one in target.type.interactions.values():
            actors = [
                group
                for group in self.scope.groups.values()
                if group.role == "asset" and group.type is not None
                if group.type.engine == one.by or group.name in played.get(one.by, ())
            ]
            if one.carried and actors:
                self._actors(node.type, target, one, actors)

    # -- one type

    def _type(self, decl: TypeDecl, one: model.Interaction, node: s.InteractionBlock) -> None:
        words = {item.name.text: item for item in node.block.items if isinstance(item, s.PropertyLine)}
        what = f"the interaction `{one.name}`"
        for key, given, hint in (
            ("by", bool(one.by), "an engine or a role"),
            ("within", one.within != UNSAID, "a length"),
        ):
            if not given and key not in words:
                self.report.at("LJ0106", node.name, f"{what} lacks `{key}`", f"add `{key}`: {hint}")
        if one.by and "by" in words:
            self._actor(words["by"], one.by)
        if self._parts_fit(node, one, words, what) and one.own:
            self._own(decl, one, words.get("takes" if one.takes else "from") or node.name, what)

    def _actor(self, item: s.PropertyLine, name: str) -> None:
        known = {kind.name for kind in builtin_engines().values() if kind.acts} | set(self._roles)
        known |= {decl.engine for decl in self.scope.types.values() if decl.role == "asset" and decl.engine}
        if name in known or self.scope.incomplete:
            return
        place, close = item.value, nearest(name, known)
        hint = did_you_mean(name, known) or f"`by` names the engine or role of who acts: {', '.join(sorted(known))}"
        decl = self.scope.types.get(name)
        if decl is not None and decl.role == "asset":
            close, hint = decl.engine, f"`by` names the engine of who acts, here `{decl.engine}`, or their role"
        message = f"no asset that is known here has the engine `{name}`"
        message += f", and no agent the role `{name}`" if self._roles else ""
        self.report.at("LJ0125", place, message, hint, replace=close)

    def _parts_fit(self, node: s.InteractionBlock, one: model.Interaction, words: _Words, what: str) -> bool:
        """Whether the words that say what is moved make one meaning together."""
        if one.takes and one.gives:
            self._excess(words, ("gives", "takes"), f"{what} both takes and gives", "declare two interactions")
        elif one.source and not (one.takes or one.gives):
            self._excess(
                words, ("from",), f"{what} takes and gives nothing `from` there", "say what: `takes` or `gives`"
            )
        elif one.up_to and not one.gives:
            self._excess(words, ("up_to",), f"{what} gives nothing `up_to` there", "`up_to` bounds what is given")
        elif one.gives and not (one.source or one.up_to):
            name = node.name
            message = f"{what} gives `{one.gives}` without end"
            self.report.at("LJ0106", name, message, "add `up_to`, a limit of the actor, or `from`")
        else:
            return True
        return False

    def _excess(self, words: _Words, keys: tuple[str, ...], message: str, hint: str) -> None:
        item = next((words[key] for key in keys if key in words), None)
        if item is not None:  # else the base type has said it, and the fault was reported there
            self.report.at("LJ0110", item, message, hint)

    def _own(self, decl: TypeDecl, one: model.Interaction, place: s.PropertyLine | s.Name, what: str) -> None:
        attribute = decl.attributes.get(one.own)
        if attribute is not None and attribute.state:
            return
        node: s.SyntaxNode = place.value if isinstance(place, s.PropertyLine) else place
        states = [name for name, known in decl.attributes.items() if known.state]
        hint = did_you_mean(one.own, states) or f"declare it: `state {one.own} = …`"
        self.report.at("LJ0126", node, f"{what} moves `{one.own}`, which is no state of it", hint)

    # -- a mission's target and who acts on it

    def _actors(self, place: s.Name, target: GroupInfo, one: model.Interaction, actors: list[GroupInfo]) -> None:
        what = f"`{one.name}` of `{target.name}`"
        able = [group for group in actors if (known := group.attributes.get(one.carried)) is not None and known.state]
        if not able:
            verb = "takes from" if one.takes else "gives"
            names = ", ".join(f"`{group.name}`" for group in actors)
            message = f"{what} {verb} the `{one.carried}` of a `{one.by}` asset, which is no state of {names}"
            states = [name for group in actors for name, known in group.attributes.items() if known.state]
            hint = did_you_mean(one.carried, states) or f"declare it with their type: `state {one.carried} = …`"
            self.report.at("LJ0126", place, message, hint)
        for group in able:
            self._measured(place, target, one, group, what)

    def _measured(self, place: s.Name, target: GroupInfo, one: model.Interaction, actor: GroupInfo, what: str) -> None:
        limit = actor.attributes.get(one.up_to)
        if one.up_to and limit is None:
            message = f"{what} fills `{actor.name}` up to its `{one.up_to}`, which it has not"
            hint = did_you_mean(one.up_to, list(actor.attributes)) or f"declare it with its type: `{one.up_to} = …`"
            self.report.at("LJ0126", place, message, hint)
        carried = (one.carried, actor, actor.attributes[one.carried])
        for name, group, attribute in _others(target, one, actor, limit):
            if not _comparable(carried[2], attribute):
                pair = f"`{actor.name}.{one.carried}` is {with_article(carried[2].type)}"
                other = f"`{group.name}.{name}` {with_article(attribute.type)}"
                message = f"{what} moves one thing between two: {pair}, {other}"
                self.report.at("LJ0210", place, message, "what is moved has one dimension at both ends")


def _others(
    target: GroupInfo, one: model.Interaction, actor: GroupInfo, limit: PropertyType | None
) -> Iterator[tuple[str, GroupInfo, PropertyType]]:
    own = target.attributes.get(one.own)
    if own is not None:
        yield one.own, target, own
    if limit is not None:
        yield one.up_to, actor, limit


def _comparable(one: PropertyType, other: PropertyType) -> bool:
    if "any" in (one.type.kind, other.type.kind):
        return True
    return one.type.kind == other.type.kind == "quantity" and one.type.dimension == other.type.dimension


def _word(entries: dict[str, PropertyEntry], key: str) -> str:
    entry = entries.get(key)
    return entry.value.ir.name if entry is not None and isinstance(entry.value.ir, ex.Symbol) else ""
