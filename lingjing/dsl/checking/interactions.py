"""Checkers of interactions: the actor, and the states between which something is moved.

`by` names an engine or a role. The roles that a type may name are those of the missions in its file.

`type` checks one target type by itself, after all types of the file are known. `between` checks a mission's target with
the assets that may act on it. Both ends of a move must be declared as states, in one dimension (ADR 0014).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from functools import cache

import msgspec

from lingjing.dsl.checking.blocks import BlockReader, DeclarationChecker
from lingjing.dsl.checking.keys import PropertyEntry, word_of
from lingjing.dsl.checking.scope import GroupInfo, TypeDecl
from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.syntax import tree as s
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.functions import Type
from lingjing.mission.interactions import UNSAID, Holder, InteractionFault, actor_fault, own_faults, shared_faults
from lingjing.suggest import did_you_mean, nearest

_WORDS = {name: name for name in ("by", "status", "takes", "gives", "up_to", "told")} | {"source": "from"}
"""Fields of an interaction → their words in the language."""


def declared(name: str, entries: dict[str, PropertyEntry], base: model.Interaction | None) -> model.Interaction:
    """The interaction that a block declares, completed by the base type's interaction of that name."""
    old = base or model.Interaction(name=name, by="", within=UNSAID)
    words = {to: word_of(entries, key) for to, key in _WORDS.items() if key in entries}
    values = {key: entries[key].value.ir for key in ("within", "lasting", "aboard") if key in entries}
    return msgspec.structs.replace(old, **words, **values)


class InteractionChecker(DeclarationChecker):
    """Checks the interactions of a file's target types, and of a mission's targets."""

    def __init__(self, blocks: BlockReader) -> None:
        super().__init__(blocks)
        self._roles: Collection[str] = ()

    def type(self, decl: TypeDecl, nodes: Iterable[s.InteractionBlock], roles: Collection[str]) -> None:
        """Check the interactions that a type of this file declares. `roles`: roles of the file's missions."""
        self._roles = roles
        for node in nodes:
            interaction = decl.interactions.get(node.name.text)
            if interaction is not None and not any(isinstance(item, s.Faulty) for item in node.block.items):
                self._type(decl, interaction, node)

    def between(self, nodes: Iterable[s.EntityBlock], agents: Iterable[model.Agent]) -> None:
        """Check that some asset in the mission has the states that the interactions of its targets move."""
        if self.scope.incomplete:
            return
        actors = self._actors(agents)
        for node in nodes:
            target = self.scope.groups.get(node.name.text)
            if node.keyword != "target" or target is None or target.type is None or node.type is None:
                continue
            holder = _holder(target)
            for interaction in target.type.interactions.values():
                for fault in shared_faults(interaction, holder, actors(interaction.by)):
                    self._report(node.type, fault)

    def _actors(self, agents: Iterable[model.Agent]) -> Callable[[str], list[Holder]]:
        """A function that gives the assets of an engine, or that agents of a role control, in declaration order."""
        played: dict[str, set[str]] = {}
        for agent in agents:
            named = {part.name for expr in agent.controls for part in ex.parts(expr) if isinstance(part, ex.Ref)}
            played.setdefault(agent.role, set()).update(named)
        assets = [group for group in self.scope.groups.values() if group.role == "asset" and group.type is not None]

        @cache  # one engine or role stands in the interactions of many targets
        def actors(by: str) -> list[Holder]:
            return [
                _holder(group)
                for group in assets
                if (group.type is not None and group.type.engine == by) or group.name in played.get(by, ())
            ]

        return actors

    # -- one type

    def _type(self, decl: TypeDecl, interaction: model.Interaction, node: s.InteractionBlock) -> None:
        words = {item.name.text: item for item in node.block.items if isinstance(item, s.PropertyLine)}
        if interaction.by and "by" in words:
            self._actor(words["by"], interaction.by)
        states = [name for name, known in decl.attributes.items() if known.state]
        for fault in own_faults(interaction, states):
            item = next((words[word] for word in fault.words if word in words), None)
            if fault.code == "LJ0106":
                if item is None:  # otherwise the line exists, and its own error is reported
                    self._report(node.name, fault)
            elif item is not None:
                self._report(item.value if fault.code == "LJ0126" else item, fault)
            elif fault.code in ("LJ0104", "LJ0126"):  # all other errors of the base type are reported there
                self._report(node.name, fault)

    def _actor(self, item: s.PropertyLine, name: str) -> None:
        engines = {decl.engine for decl in self.scope.types.values() if decl.role == "asset" and decl.engine}
        fault = actor_fault(name, engines, self._roles)
        if fault is None or self.scope.incomplete:
            return
        place, close = item.value, nearest(name, fault.known)
        hint = did_you_mean(name, fault.known) or fault.hint
        decl = self.scope.types.get(name)
        if decl is not None and decl.role == "asset":
            close, hint = decl.engine, f"`by` names the actor's engine, here `{decl.engine}`, or its role"
        self.report.at(fault.code, place, fault.message, hint, replace=close)

    def _report(self, place: s.SyntaxNode, fault: InteractionFault) -> None:
        hint = (did_you_mean(fault.wrong, fault.known) if fault.wrong else "") or fault.hint
        self.report.at(fault.code, place, fault.message, hint)


def _holder(group: GroupInfo) -> Holder:
    kinds = {name: _kind(known.type) for name, known in group.attributes.items()}
    return Holder(group.name, kinds, [name for name, known in group.attributes.items() if known.state])


def _kind(typed: Type) -> str:
    return "" if typed.kind == "any" else with_article(typed)
