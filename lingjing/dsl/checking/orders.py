"""The order of stages: `serial find, save` and `parallel scan, guard` become dependencies between stages.

A stage of `serial` waits for the stage before it. Stages of `parallel` wait for the same stages, and the same stages
wait for them: each has the dependencies of all.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

import msgspec

from lingjing.dsl.checking.blocks import DeclarationChecker
from lingjing.dsl.syntax import tree as s
from lingjing.mission import model

_Pair = tuple[str, str]
"""A stage, and a stage that waits for it."""


class OrderChecker(DeclarationChecker):
    """Checks the statements `serial` and `parallel` of a mission."""

    def relations(
        self, nodes: Sequence[s.OrderLine], declared: tuple[model.Relation, ...]
    ) -> tuple[model.Relation, ...]:
        """All relations of the mission: the declared ones with those that the statements add."""
        sound = [node for node in nodes if self._is_sound(node)]
        waits = {
            (relation.source, relation.target): relation
            for relation in declared
            if relation.kind == "dependency" and relation.when is None and not relation.mutual
        }
        for node in sound:
            if node.keyword == "serial":
                for before, after in itertools.pairwise(node.stages):
                    _add(waits, (before.text, after.text), serial=True)
        sets = [(node, tuple(name.text for name in node.stages)) for node in sound if node.keyword == "parallel"]
        while any(_share(waits, names) for _, names in sets):
            pass
        for node, names in sets:
            self._never_wait(node, names, waits)
        added = [relation for relation in waits.values() if relation not in declared]
        replaced = {(relation.source, relation.target) for relation in added}
        kept = [each for each in declared if each.kind != "dependency" or (each.source, each.target) not in replaced]
        return tuple(sorted((*kept, *added), key=lambda relation: relation.serial))

    def _is_sound(self, node: s.OrderLine) -> bool:
        """True if the statement names two or more different stages. Reports other statements."""
        names = [name.text for name in node.stages]
        for place, name in enumerate(node.stages):
            if name.text not in self.scope.stages:
                self.of.unknown_name(name, list(self.scope.stages), "no stage")
            elif name.text in names[:place]:
                self.report.at("LJ0103", name, f"`{name.text}` is given twice")
        if len(node.stages) < 2:
            hint = f"name the others: `{node.keyword} {names[0]}, …`"
            self.report.at("LJ0106", node.stages[0], f"`{node.keyword}` is about two or more stages", hint)
        return len(set(names)) == len(names) > 1 and all(name in self.scope.stages for name in names)

    def _never_wait(self, node: s.OrderLine, names: tuple[str, ...], waits: dict[_Pair, model.Relation]) -> None:
        """Report stages of `parallel` of which one waits for another."""
        for name in node.stages:
            later = _after(name.text, waits) & set(names)
            if later:
                message = f"`{sorted(later)[0]}` waits for `{name.text}`, so that they are not parallel"
                self.report.at("LJ0606", name, message, "remove one of the two orders")
                return


def _add(waits: dict[_Pair, model.Relation], pair: _Pair, *, serial: bool) -> bool:
    """Add a dependency, or make a known one serial. True if something changed."""
    known = waits.get(pair)
    if known is not None and (known.serial or not serial):
        return False
    base = known or model.Relation(kind="dependency", source=pair[0], target=pair[1])
    waits[pair] = msgspec.structs.replace(base, serial=serial)
    return True


def _share(waits: dict[_Pair, model.Relation], names: tuple[str, ...]) -> bool:
    """Give each stage of a set the dependencies of all. True if something changed."""
    changed = False
    for (source, target), relation in list(waits.items()):
        if source in names and target in names:
            continue
        pairs: Iterable[_Pair] = ()
        if target in names:
            pairs = ((source, name) for name in names)
        elif source in names:
            pairs = ((name, target) for name in names)
        for pair in pairs:
            changed = _add(waits, pair, serial=relation.serial) or changed
    return changed


def _after(stage: str, waits: Iterable[_Pair]) -> set[str]:
    """The stages that wait for a stage, directly or through others."""
    reached: set[str] = set()
    queue = [stage]
    while queue:
        name = queue.pop()
        for source, target in waits:
            if source == name and target not in reached:
                reached.add(target)
                queue.append(target)
    return reached
