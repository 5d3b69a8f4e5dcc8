"""`replay`: whether a trace's decisions lead on fresh engines to the states that it holds, or what differs first."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import msgspec

from lingjing.causal.picture_comparison import PictureWitness
from lingjing.causal.recorded import RecordedRun
from lingjing.errors import InfrastructureError
from lingjing.kernel.episode import ended_because
from lingjing.kernel.world import WorldKind
from lingjing.numerics import versions
from lingjing.plugins.host import PluginHost
from lingjing.trace.digest import current_digests
from lingjing.trace.digest_form import full_form
from lingjing.trace.encoding import normalise
from lingjing.trace.reader import Trace
from lingjing.trace.records import CUT_SHORT, BoundaryRecord

KERNEL = "kernel"
CAMERA = "camera"


class Difference(msgspec.Struct, frozen=True, kw_only=True):
    """The first place where a replay leaves its trace: the engine that answers for it (`kernel` for what none
    does), the field, and the two values as JSON, cut."""

    boundary: int
    engine: str
    field: str
    recorded: str
    replayed: str


class Replay(msgspec.Struct, frozen=True, kw_only=True):
    """What running a trace again has shown. `confirmed` boundaries had the digest that the trace has for them;
    without a `difference` these are all of `boundaries`.

    Of a file that was cut or damaged only what is before the fault is there to be run: `ends` says whether the
    episode's outcome is in it.

    `drawn` if pictures were drawn anew; else their poses and boxes were taken from the trace. A picture that shows
    something else is a difference. `pixels` is the first one that another renderer drew and whose pixels differ within
    the tolerance of `lingjing.causal.picture_comparison`. `versions` are the libraries that differ
    from those the trace was made with: the digest is promised for equal ones.
    """

    path: str
    boundaries: int
    confirmed: int
    digest: str
    ends: bool = True
    difference: Difference | None = None
    drawn: bool = False
    pixels: str = ""
    versions: tuple[str, ...] = ()


def replay(
    trace: Trace,
    *,
    world: WorldKind = "process",
    draw: bool = False,
    host: PluginHost | None = None,
    progress: Callable[[int], None] | None = None,
) -> Replay:
    """Run a trace again, whole or partial, to its last boundary or the first that differs.

    `progress` is called with each boundary that was confirmed. Raises what `RecordedRun` raises.
    """
    difference, confirmed = None, 0
    witness = PictureWitness(trace)
    with RecordedRun(trace, world=world, draw=draw, host=host) as run:
        run.pictures.witness = witness
        for recorded, digest in zip(trace.boundaries, current_digests(trace), strict=True):
            try:
                record = run.advance().record
            except InfrastructureError as error:
                difference = Difference(
                    boundary=recorded.tick, engine="", field="", recorded="a boundary", replayed=f"{error}"
                )
                break
            difference = _other_deciders(trace, recorded)
            if difference is None and record.digest != digest:
                difference = first_difference(trace, recorded, record)
            difference = difference or _other_picture(recorded.tick, witness)
            if difference is not None:
                break
            confirmed += 1
            if progress is not None:
                progress(recorded.tick)
        if difference is None:
            difference = _other_ending(trace, run)
    return Replay(
        path=str(trace.path),
        boundaries=len(trace.boundaries),
        confirmed=confirmed,
        digest=trace.boundaries[-1].digest,
        ends=trace.outcome is not None,
        difference=difference,
        drawn=draw,
        pixels=witness.tolerated,
        versions=tuple(_other_versions(trace)),
    )


def _other_deciders(trace: Trace, recorded: BoundaryRecord) -> Difference | None:
    """Whether decisions are not one of each of the instance's agents, in their order; before boundary 0 nobody decides.
    They are what is replayed, so no digest tells: whoever is missing would count as having done nothing."""
    agents = [agent.id for agent in trace.header.instance.agents] if recorded.tick else []
    made = [one.agent for one in recorded.decisions]
    if made == agents:
        return None
    return Difference(
        boundary=recorded.tick, engine=KERNEL, field="decisions", recorded=_cut(made),
        replayed=f"one of each, in this order: {_cut(agents)}",
    )  # fmt: skip


def first_difference(trace: Trace, recorded: BoundaryRecord, replayed: BoundaryRecord) -> Difference:
    """Where two records of one boundary differ first, in the order of the record's fields."""
    pair = [full_form(normalise(record)) for record in (recorded, replayed)]
    for field in pair[0]:
        for path, here, there in _differences(pair[0].get(field), pair[1].get(field), field):
            engine = _engine(trace, path, pair)
            return Difference(
                boundary=recorded.tick,
                engine=engine,
                field=_spelled(path, pair),
                recorded=_cut(here),
                replayed=_cut(there),
            )
    return Difference(
        boundary=recorded.tick,
        engine=KERNEL,
        field="digest",
        recorded=recorded.digest,
        replayed=f"{replayed.digest} (of an equal record: the trace's digest is not that of its content)",
    )


def _differences(here: Any, there: Any, *path: Any) -> Iterator[tuple[tuple[Any, ...], Any, Any]]:
    """The innermost values that differ, in order, with the way to each."""
    if here == there:
        return
    if isinstance(here, dict) and isinstance(there, dict):
        for name in dict.fromkeys((*here, *there)):
            yield from _differences(here.get(name), there.get(name), *path, name)
    elif isinstance(here, list | tuple) and isinstance(there, list | tuple) and len(here) == len(there):
        for index, (one, other) in enumerate(zip(here, there, strict=True)):
            yield from _differences(one, other, *path, index)
    else:
        yield path, here, there


def _engine(trace: Trace, path: tuple[Any, ...], pair: list[dict[str, Any]]) -> str:
    """Who answers for a field: the engine that owns the entity it is about, or that gave it."""
    owners = {entity.id: entity.engine for entity in trace.header.instance.entities}
    if path[0] == "frames":
        return CAMERA
    for value in reversed(list(_along(path, pair[0]))):
        if not isinstance(value, dict):
            continue
        if "engine" in value:
            return str(value["engine"])
        if path[0] == "receipts" and "by" in value:
            return str(value["by"])
        named = [value.get("id"), value.get("entity"), *(value.get("entities") or ())]
        found = next((owners[name] for name in named if isinstance(name, str) and name in owners), None)
        if found is not None:
            return found
    return "the engine of background movers" if "ambient" in path else KERNEL


def _along(path: tuple[Any, ...], value: Any) -> Iterator[Any]:
    """The values on the way to a field; None where the last step leads to what is not there."""
    for step in path:
        value = value.get(step) if isinstance(value, dict) else value[step]
        yield value


def _spelled(path: tuple[Any, ...], pair: list[dict[str, Any]]) -> str:
    """`snapshots[3].states[uav[1]].position[0]`: elements that have an id are called by it."""
    text = ""
    for step, value in zip(path, _along(path, pair[0]), strict=True):
        if isinstance(step, int):
            name = value.get("id") or value.get("agent") or value.get("request") if isinstance(value, dict) else None
            text += f"[{name or step}]"
        else:
            text += f".{step}" if text else step
    return text


def _cut(value: Any) -> str:
    text = msgspec.json.encode(value).decode()
    return text if len(text) <= 200 else f"{text[:200]}…"


def _other_picture(tick: int, witness: PictureWitness) -> Difference | None:
    """The first picture of the trace that does not show what the same picture shows when it is drawn anew."""
    if witness.differing is None:
        return None
    recorded, drawn, what = witness.differing
    return Difference(
        boundary=tick,
        engine=CAMERA,
        field=f"frames[{recorded.id}].pixels",
        recorded=f"sha256 {recorded.sha256[:16]}… ({recorded.renderer})",
        replayed=f"sha256 {drawn.sha256[:16]}… ({drawn.renderer}): {what}",
    )


def _other_ending(trace: Trace, run: RecordedRun) -> Difference | None:
    """Whether the outcome follows from the last boundary as this version judges it."""
    outcome = trace.outcome
    if outcome is None or outcome.reason in CUT_SHORT:
        return None
    reason, detail = ended_because(run.kernel)
    if (reason, detail) == (outcome.reason, outcome.detail):
        return None
    at = trace.boundaries[-1].tick
    told = [" ".join(filter(None, one)) for one in ((outcome.reason, outcome.detail), (reason or "not over", detail))]
    return Difference(boundary=at, engine=KERNEL, field="outcome.reason", recorded=told[0], replayed=told[1])


def _other_versions(trace: Trace) -> Iterator[str]:
    here = versions()
    for name, version in trace.header.fingerprint.items():
        if here.get(name) != version:
            yield f"{name} {version} (here {here.get(name, 'none')})"
