"""Cyclic dependencies: stages or interactions that wait for themselves."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from lingjing.mission import expression as ex
from lingjing.mission.conditions.condition_needs import of_groups
from lingjing.mission.conditions.needs import AtLeast, Need, Performed
from lingjing.mission.conditions.outline import Outline
from lingjing.mission.feasibility.proof import Proof
from lingjing.mission.model import RuleParameter, Unlock


def refute_order(outline: Outline) -> list[Proof]:
    """Proofs of cyclic dependencies between stages, and of interactions that their own unlocking waits for."""
    return [*_stages(outline), *_unlocks(outline)]


def circle(edges: Mapping[str, Iterable[str]]) -> tuple[str, ...]:
    """The first cycle of a graph in the order of its nodes, with the first node repeated at its end; () if there is
    none."""
    finished: set[str] = set()
    for start in edges:
        cycle = _walk(start, edges, finished)
        if cycle:
            return cycle
    return ()


def _walk(start: str, edges: Mapping[str, Iterable[str]], finished: set[str]) -> tuple[str, ...]:
    """Iterative depth-first search: `path` holds the nodes from the start, `branches` the untried successors
    of each."""
    if start in finished:
        return ()
    path, branches = [start], [iter(edges.get(start, ()))]
    while path:
        step = next(branches[-1], None)
        if step is None:
            finished.add(path.pop())
            branches.pop()
        elif step in path:
            return (*path[path.index(step) :], step)
        elif step not in finished:
            path.append(step)
            branches.append(iter(edges.get(step, ())))
    return ()


def _reachable(starts: list[str], edges: Mapping[str, list[str]]) -> list[str]:
    """All nodes that can be reached from the starts, these included."""
    reached = dict.fromkeys(starts)
    queue = list(starts)
    while queue:
        for name in edges[queue.pop(0)]:
            if name not in reached:
                reached[name] = None
                queue.append(name)
    return list(reached)


def _stages(outline: Outline) -> list[Proof]:
    """Proofs of cycles of `dependency a -> b`, where b begins when a has ended."""
    relations = [relation for relation in outline.instance.relations if relation.kind == "dependency"]
    edges: dict[str, list[str]] = {}
    for relation in relations:
        edges.setdefault(relation.source, []).append(relation.target)
        if relation.mutual:
            edges.setdefault(relation.target, []).append(relation.source)
    cycle = circle(edges)
    if not cycle:
        return []
    way = " -> ".join(f"`{name}`" for name in cycle)
    return [
        Proof(
            "LJ0606",
            f"dependency/{cycle[0]}/{cycle[1]}",
            f"these stages wait for each other: {way}; none of them can begin",
            "remove one of the dependencies",
            tuple((f"stage/{name}", "waits") for name in cycle[:-1]),
        )
    ]


def _unlocks(outline: Outline) -> list[Proof]:
    """Proofs that an interaction's unlocking requires an earlier interaction of the same kind. Only interactions that
    success needs count."""
    unlocks: dict[str, list[Unlock]] = {}
    for unlock in outline.instance.unlocks:
        unlocks.setdefault(unlock.interaction, []).append(unlock)
    edges = {
        name: sorted(_before(same_kind[0].condition, same_kind[0].parameters, outline) & unlocks.keys())
        if len(same_kind) == 1
        else []
        for name, same_kind in unlocks.items()
    }
    needed = sorted(_before(outline.instance.success, (), outline) & unlocks.keys())
    cycle = circle({name: edges[name] for name in _reachable(needed, edges)})
    if not cycle:
        return []
    way = " -> ".join(f"`{name}`" for name in cycle)
    return [
        Proof(
            "LJ0606",
            f"unlock/{cycle[0]}",
            f"unlocking `{cycle[0]}` waits for an event that can happen only after it: {way}",
            "unlock it on an event that can happen earlier",
            tuple((f"unlock/{name}", "waits") for name in cycle[1:-1]),
        )
    ]


def _before(condition: ex.Expr, parameters: tuple[RuleParameter, ...], outline: Outline) -> set[str]:
    """Names of interactions that must have been performed once the condition is true."""
    return _performed(of_groups(condition, outline, {parameter.name: parameter.domain for parameter in parameters}))


def _performed(need: Need) -> set[str]:
    if isinstance(need, Performed):
        return {need.interaction}
    if not isinstance(need, AtLeast) or need.least == 0:
        return set()
    each = [_performed(part) for part in need.parts]
    return set().union(*each) if need.least == len(each) else set.intersection(*each)
