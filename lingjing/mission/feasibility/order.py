"""Order: what waits for itself never happens."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from lingjing.mission import expression as ex
from lingjing.mission.feasibility.condition_needs import of_groups
from lingjing.mission.feasibility.needs import AtLeast, Need, Performed
from lingjing.mission.feasibility.outline import Outline
from lingjing.mission.feasibility.proof import Proof
from lingjing.mission.model import RuleParameter, Unlock


def refute_order(outline: Outline) -> list[Proof]:
    """Stages that depend on each other in a circle, and interactions whose unlocking waits for them."""
    return [*_stages(outline), *_unlocks(outline)]


def circle(edges: Mapping[str, Iterable[str]]) -> tuple[str, ...]:
    """The first circle of a graph in the order of its nodes, beginning and ending with the same one, or nothing."""
    done: set[str] = set()
    for start in edges:
        found = _walk(start, edges, done)
        if found:
            return found
    return ()


def _walk(start: str, edges: Mapping[str, Iterable[str]], done: set[str]) -> tuple[str, ...]:
    """Depth first without recursion: `way` is the path, `left` what is still to be tried from each of its nodes."""
    if start in done:
        return ()
    way, left = [start], [iter(edges.get(start, ()))]
    while way:
        step = next(left[-1], None)
        if step is None:
            done.add(way.pop())
            left.pop()
        elif step in way:
            return (*way[way.index(step) :], step)
        elif step not in done:
            way.append(step)
            left.append(iter(edges.get(step, ())))
    return ()


def _reachable(starts: list[str], edges: Mapping[str, list[str]]) -> list[str]:
    """All that is waited for, directly or through others."""
    found = dict.fromkeys(starts)
    waiting = list(starts)
    while waiting:
        for name in edges[waiting.pop(0)]:
            if name not in found:
                found[name] = None
                waiting.append(name)
    return list(found)


def _stages(outline: Outline) -> list[Proof]:
    """`dependency a -> b`: b begins when a has ended."""
    relations = [relation for relation in outline.instance.relations if relation.kind == "dependency"]
    edges: dict[str, list[str]] = {}
    for relation in relations:
        edges.setdefault(relation.source, []).append(relation.target)
        if relation.mutual:
            edges.setdefault(relation.target, []).append(relation.source)
    found = circle(edges)
    if not found:
        return []
    way = " -> ".join(f"`{name}`" for name in found)
    return [
        Proof(
            "LJ0606",
            f"dependency/{found[0]}/{found[1]}",
            f"these stages wait for each other: {way}; none of them can begin",
            "take one of the dependencies out",
            tuple((f"stage/{name}", "waits") for name in found[:-1]),
        )
    ]


def _unlocks(outline: Outline) -> list[Proof]:
    """An interaction is performed only after its unlocking; that must not take an earlier one of the same kind. Only
    interactions that success needs count."""
    unlocks: dict[str, list[Unlock]] = {}
    for unlock in outline.instance.unlocks:
        unlocks.setdefault(unlock.interaction, []).append(unlock)
    edges = {
        name: sorted(_before(found[0].condition, found[0].parameters, outline) & unlocks.keys())
        if len(found) == 1
        else []
        for name, found in unlocks.items()
    }
    needed = sorted(_before(outline.instance.success, (), outline) & unlocks.keys())
    found = circle({name: edges[name] for name in _reachable(needed, edges)})
    if not found:
        return []
    way = " -> ".join(f"`{name}`" for name in found)
    return [
        Proof(
            "LJ0606",
            f"unlock/{found[0]}",
            f"unlocking `{found[0]}` waits for what only happens once it is unlocked: {way}",
            "unlock it on something that can happen before",
            tuple((f"unlock/{name}", "waits") for name in found[1:-1]),
        )
    ]


def _before(condition: ex.Expr, parameters: tuple[RuleParameter, ...], outline: Outline) -> set[str]:
    """Interactions of which some must have been performed once the condition is true."""
    return _performed(of_groups(condition, outline, {one.name: one.domain for one in parameters}))


def _performed(need: Need) -> set[str]:
    if isinstance(need, Performed):
        return {need.interaction}
    if not isinstance(need, AtLeast) or need.least == 0:
        return set()
    each = [_performed(part) for part in need.parts]
    return set().union(*each) if need.least == len(each) else set.intersection(*each)
