"""Replay of a trace: its recorded decisions on fresh engines, compared with its states."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import msgspec

from lingjing.causal.picture_comparison import PictureWitness
from lingjing.causal.recorded import RecordedRun
from lingjing.errors import InfrastructureError
from lingjing.kernel.episode import end_reason
from lingjing.kernel.world import WorldKind
from lingjing.mission.salts import SALT_KEY, SEED_KEY
from lingjing.numerics import versions
from lingjing.plugins.host import PluginHost
from lingjing.trace.digest import current_digests
from lingjing.trace.digest_form import full_form
from lingjing.trace.encoding import normalise
from lingjing.trace.reader import Trace
from lingjing.trace.records import CUT_SHORT, BoundaryRecord

KERNEL = "kernel"
"""The engine's name in differences that belong to no engine."""

CAMERA = "camera"
"""The engine's name in differences of pictures."""


_NO_LIBRARIES = ("walls", SALT_KEY, SEED_KEY)
"""The entries of a fingerprint that name no library: the walls of its policies, and the salt of a sealed split."""


class Difference(msgspec.Struct, frozen=True, kw_only=True):
    """The first difference between a trace and its replay."""

    boundary: int
    """The boundary of the difference."""
    engine: str
    """The engine that produced the field; `kernel` if none did."""
    field: str
    """The path of the field in the record."""
    recorded: str
    """The recorded value as JSON, cut to 200 characters."""
    replayed: str
    """The replayed value as JSON, cut to 200 characters."""


class Replay(msgspec.Struct, frozen=True, kw_only=True):
    """The result of a replay."""

    path: str
    boundaries: int
    """The number of boundaries in the file."""
    confirmed: int
    """The number of boundaries with equal digests; all of them if there is no difference."""
    digest: str
    """The digest of the last boundary in the file."""
    ends: bool = True
    """False if the file was cut or damaged and its outcome is missing."""
    difference: Difference | None = None
    """The first difference; None if there is none."""
    drawn: bool = False
    """True if pictures were rendered again; else their poses and boxes were taken from the trace."""
    pixels: str = ""
    """The first picture with pixels that differ within the tolerance of two renderers (`picture_comparison`); else
    empty.
    """
    versions: tuple[str, ...] = ()
    """Libraries with versions other than the recorded ones. Equal digests are guaranteed for equal versions only."""


def replay(
    trace: Trace,
    *,
    world: WorldKind = "process",
    draw: bool = False,
    host: PluginHost | None = None,
    progress: Callable[[int], None] | None = None,
) -> Replay:
    """Run a trace again, complete or partial, to its last boundary or the first difference.

    >>> replayed = lingjing.replay(lingjing.read("runs/first"))
    >>> replayed.difference is None, replayed.confirmed == replayed.boundaries
    (True, True)

    `progress` is called with each confirmed boundary. Raises the errors of `RecordedRun`.
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
            difference = _decision_difference(trace, recorded)
            if difference is None and record.digest != digest:
                difference = first_difference(trace, recorded, record)
            difference = difference or _picture_difference(recorded.tick, witness)
            if difference is not None:
                break
            confirmed += 1
            if progress is not None:
                progress(recorded.tick)
        if difference is None:
            difference = _outcome_difference(trace, run)
    return Replay(
        path=str(trace.path),
        boundaries=len(trace.boundaries),
        confirmed=confirmed,
        digest=trace.boundaries[-1].digest,
        ends=trace.outcome is not None,
        difference=difference,
        drawn=draw,
        pixels=witness.tolerated,
        versions=tuple(_different_versions(trace)),
    )


def _decision_difference(trace: Trace, recorded: BoundaryRecord) -> Difference | None:
    """Return a difference unless the decisions are one of each agent, in the order of the instance; boundary 0 has
    none.

    Decisions are the input of the replay, so no digest covers them: a missing one would be played as no action.
    """
    agents = [agent.id for agent in trace.header.instance.agents] if recorded.tick else []
    made = [decision.agent for decision in recorded.decisions]
    if made == agents:
        return None
    return Difference(
        boundary=recorded.tick, engine=KERNEL, field="decisions", recorded=_cut(made),
        replayed=f"one of each, in this order: {_cut(agents)}",
    )  # fmt: skip


def first_difference(trace: Trace, recorded: BoundaryRecord, replayed: BoundaryRecord) -> Difference:
    """Return the first difference of two records of one boundary, in the order of the record's fields."""
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
    """Yield the innermost different values in order, each with its path."""
    if here == there:
        return
    if isinstance(here, dict) and isinstance(there, dict):
        for name in dict.fromkeys((*here, *there)):
            yield from _differences(here.get(name), there.get(name), *path, name)
    elif isinstance(here, list | tuple) and isinstance(there, list | tuple) and len(here) == len(there):
        for index, (left, right) in enumerate(zip(here, there, strict=True)):
            yield from _differences(left, right, *path, index)
    else:
        yield path, here, there


def _engine(trace: Trace, path: tuple[Any, ...], pair: list[dict[str, Any]]) -> str:
    """Return the engine of a field: the owner of its entity, or the engine that produced it."""
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
        owner = next((owners[name] for name in named if isinstance(name, str) and name in owners), None)
        if owner is not None:
            return owner
    return "the engine of background movers" if "ambient" in path else KERNEL


def _along(path: tuple[Any, ...], value: Any) -> Iterator[Any]:
    """Yield the values along a path; None for a missing last value."""
    for step in path:
        value = value.get(step) if isinstance(value, dict) else value[step]
        yield value


def _spelled(path: tuple[Any, ...], pair: list[dict[str, Any]]) -> str:
    """Return a path as text, with ids in place of indices: `snapshots[3].states[uav[1]].position[0]`."""
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


def _picture_difference(tick: int, witness: PictureWitness) -> Difference | None:
    """Return the first picture that differs from the recorded one."""
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


def _outcome_difference(trace: Trace, run: RecordedRun) -> Difference | None:
    """Return a difference unless this version derives the recorded outcome from the last boundary."""
    outcome = trace.outcome
    if outcome is None or outcome.reason in CUT_SHORT:
        return None
    reason, detail = end_reason(run.kernel)
    if (reason, detail) == (outcome.reason, outcome.detail):
        return None
    at = trace.boundaries[-1].tick
    outcomes = [
        " ".join(filter(None, parts)) for parts in ((outcome.reason, outcome.detail), (reason or "not over", detail))
    ]
    return Difference(boundary=at, engine=KERNEL, field="outcome.reason", recorded=outcomes[0], replayed=outcomes[1])


def _different_versions(trace: Trace) -> Iterator[str]:
    here = versions()
    for name, version in trace.header.fingerprint.items():
        if here.get(name) != version and name not in _NO_LIBRARIES:
            yield f"{name} {version} (here {here.get(name, 'none')})"
