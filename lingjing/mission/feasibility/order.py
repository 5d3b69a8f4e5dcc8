"""Cyclic dependencies of stages: a hint, not a proof, because success does not depend on stages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from lingjing.mission import model
from lingjing.mission.feasibility.proof import Proof


def circular_stages(mission: model.Mission) -> tuple[Proof, ...]:
    """A hint for a cycle of `dependency a -> b`, where b begins when a has ended."""
    edges: dict[str, list[str]] = {}
    for relation in mission.relations:
        if relation.kind != "dependency" or relation.when is not None:
            continue
        edges.setdefault(relation.source, []).append(relation.target)
        if relation.mutual:
            edges.setdefault(relation.target, []).append(relation.source)
    cycle = circle(edges)
    if not cycle:
        return ()
    way = " -> ".join(f"`{name}`" for name in cycle)
    return (
        Proof(
            "LJ0606",
            f"dependency/{cycle[0]}/{cycle[1]}",
            f"these stages wait for each other: {way}; none of them can begin",
            "remove one of the dependencies",
            tuple((f"stage/{name}", "waits") for name in cycle[:-1]),
        ),
    )


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
