"""The checks of an engine as a whole: its boundaries, its repeatability, its pictures, and its end."""

from __future__ import annotations

import hashlib
import math
import sys
from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from lingjing.decoding import from_msgpack
from lingjing.mission.instance import CameraSpec, Instance
from lingjing.plugins.conformance.boundaries import check_boundary, check_events, check_route_numbers
from lingjing.plugins.conformance.case import (
    ConformanceError,
    EngineCase,
    Run,
    advance,
    drive,
    engine_of,
    play,
    require,
    reset,
    run_all,
)
from lingjing.plugins.conformance.described import check_speed, check_words
from lingjing.plugins.conformance.requests import (
    check_admission,
    check_arguments,
    check_busy,
    check_commands,
    check_preemption,
    check_receipts,
    check_refusals,
)
from lingjing.plugins.engine import Boundary, CaptureRequest, Engine, EnginePlugin, Frame, KeyedPictures
from lingjing.plugins.hook_faults import check_declaration
from lingjing.plugins.options import declared_model
from lingjing.processes.linux import run_in_fork
from lingjing.scene.city import City
from lingjing.trace.records import BodyState, Command

_TOLERANCE = 1e-6
"""The allowed difference of numbers, relative to numbers above 1. Chosen."""


def check_engine(
    plugin: EnginePlugin,
    instance: Instance,
    city: City,
    commands: Sequence[Command] = (),
    *,
    mirrors: Sequence[BodyState] = (),
    seed: int = 1,
    seconds: float = 20.0,
    placed: bool = True,
) -> None:
    """Run every check of an engine. Raises one `ConformanceError` that lists all failed checks."""
    check_declaration(plugin, "lingjing_engines", plugin.name)
    case = EngineCase(plugin, instance, city, tuple(commands), tuple(mirrors), seed, seconds, placed)
    run_all(f"engine `{plugin.name}`", ENGINE_CHECKS, case)


def check_ready(case: EngineCase) -> None:
    """Check that `reset` returns every owned entity at time 0 and at its place, without receipts and events."""
    with engine_of(case) as engine:
        ready = reset(engine, case)
    check_boundary(case, ready, 0.0)
    require(not ready.receipts and not ready.events, "reset: receipts or events before anything happened")
    for entity, state in zip(case.owned, ready.states, strict=True):
        away = math.dist(entity.position[:2], state.position[:2])
        at_home = away < 0.01 or not case.placed
        require(at_home, f"reset: `{entity.id}` stands {away:.2f} m away from where the instance puts it")


def check_advance(case: EngineCase) -> None:
    """Check that `advance` reaches the requested time with every owned entity, and with events of that interval
    only."""
    run, start = play(case), 0.0
    for until, boundary in zip(case.times(), run.boundaries, strict=True):
        check_boundary(case, boundary, until)
        check_events(boundary, start, until)
        start = until
    check_route_numbers(route for boundary in (run.ready, *run.boundaries) for route in boundary.routes)


def check_strangers(case: EngineCase) -> None:
    """Check that the engine accepts mirrors of any body, and returns none of them as its own.

    The mirrors are all entities of other engines, dormant ones included, background traffic, and unknown ids.
    """
    crowd = [
        BodyState(id=entity.id, position=entity.position, status="dormant" if entity.dormant else "idle")
        for entity in case.instance.entities
        if entity.engine != case.plugin.name
    ]
    crowd += [
        BodyState(id="conformance/1", kind="truck", position=(4000.0, 4000.0, 0.0), velocity=(10.0, 0.0, 0.0)),
        BodyState(id="conformance/2", kind="conformance.noSuchKind", position=(4000.0, 4010.0, 0.0)),
    ]
    with engine_of(case) as engine:
        reset(engine, case)
        engine.submit(case.commands)
        for until in case.times()[:4]:
            boundary = engine.advance(until, crowd)
            check_boundary(case, boundary, until)
            echoed = {state.id for state in crowd} & {state.id for state in boundary.ambient}
            require(not echoed, f"advance: mirrors come back as ambient bodies: {', '.join(sorted(echoed))}")


def check_repeatable(case: EngineCase) -> None:
    """Check that the same inputs give the same answers, in a second engine and after another reset."""
    with engine_of(case) as engine:
        first = _digest(drive(engine, case))
        again = _digest(drive(engine, case))
    require(first == again, "an engine that is reset a second time answers differently")
    require(first == _digest(play(case)), "two engines with the same inputs answer differently")


def check_cuts(case: EngineCase) -> None:
    """Check that an interval gives the same result as its two halves.

    It is skipped unless both halves end on the engine's own steps (`native_dt_s`). There are no other bodies, because
    their mirrors would be older in the longer interval.
    """
    half = case.step_s / 2.0
    steps = half / case.plugin.native_dt_s
    if case.plugin.sensor or case.plugin.place == "remote" or abs(steps - round(steps)) > _TOLERANCE:
        return
    alone = EngineCase(case.plugin, case.instance, case.city, case.commands, (), case.seed, case.seconds, case.placed)
    times = alone.times()
    whole = play(alone).boundaries
    halves = play(alone, [time for until in times for time in (until - half, until)]).boundaries
    for boundary, first, second in zip(whole, halves[::2], halves[1::2], strict=True):
        where = f"at {boundary.time_s} s, when the interval before is cut in two"
        for state, other in zip(boundary.states, second.states, strict=True):
            require(_close(state, other), f"`{state.id}` is somewhere else {where}: {state} and {other}")
        ends = [(receipt.request, receipt.status) for receipt in boundary.receipts if receipt.status != "running"]
        cut = (*first.receipts, *second.receipts)
        require(
            ends == [(receipt.request, receipt.status) for receipt in cut if receipt.status != "running"],
            f"requests end differently {where}",
        )
        events = [(event.kind, event.entities) for event in (*first.events, *second.events)]
        require([(e.kind, e.entities) for e in boundary.events] == events, f"other events happen {where}")


def check_values(case: EngineCase) -> None:
    """Check that boundaries stay equal when they are encoded and decoded (msgpack)."""
    run = play(case)
    for boundary in (run.ready, *run.boundaries):
        try:
            packed = msgspec.msgpack.encode(boundary)
        except TypeError as error:
            raise ConformanceError(f"a boundary holds a value that is no plain number or text: {error}") from error
        require(from_msgpack(packed, Boundary) == boundary, "a boundary changes when it is packed")


def check_options(case: EngineCase) -> None:
    """Check that the model of options that the declaration names can be loaded."""
    declared_model(case.plugin.options, f"engine `{case.plugin.name}`")


def check_fork(case: EngineCase) -> None:
    """Check that an engine of a world process continues bit by bit identically in a fork of its process."""
    if case.plugin.place != "world" or sys.platform != "linux":
        return
    times = case.times()
    half = len(times) // 2
    with engine_of(case) as engine:
        reset(engine, case)
        engine.submit(case.commands)
        advance(engine, case, 0.0, times[:half])
        start = times[half - 1] if half else 0.0
        forked = run_in_fork(lambda: _rest(engine, case, start, times[half:]))
        own = _rest(engine, case, start, times[half:])
    require(forked == own, "a forked engine answers differently from its parent")


def check_capture(case: EngineCase) -> None:
    """Check that `capture` returns one picture for each request, in order and as declared.

    An engine without sensors returns (). If an engine has picture keys, equal keys must give equal pictures after
    everything has moved.
    """
    mounts = [(entity, camera) for entity in case.instance.entities for camera in entity.cameras]
    with engine_of(case) as engine:
        reset(engine, case)
        until = case.times()[0]
        engine.advance(until, case.mirrors)
        requests = tuple(
            CaptureRequest(
                frame=f"f1-{entity.id}-{camera.name}", entity=entity.id, camera=camera.name, tick=1, time_s=until
            )
            for entity, camera in mounts
        )
        frames = engine.capture(requests) if case.plugin.sensor else engine.capture(())
        if isinstance(engine, KeyedPictures):
            _check_keys(engine, case, requests, frames)
    require(len(frames) == (len(requests) if case.plugin.sensor else 0), f"capture: {len(frames)} pictures")
    for request, frame, (_, camera) in zip(requests, frames, mounts, strict=False):
        _frame(request, frame, camera)


def _check_keys(engine: Engine, case: EngineCase, requests: Sequence[CaptureRequest], frames: Sequence[Frame]) -> None:
    """Check the keys of pictures after the other bodies have moved."""
    assert isinstance(engine, KeyedPictures)
    before = [engine.picture_key(request) for request in requests]
    require(all(isinstance(key, bytes) for key in before), "picture_key: a key is not of type bytes")
    elsewhere = [BodyState(id=entity.id, position=(0.0, 0.0, 0.0)) for entity in case.instance.entities]
    engine.advance(case.times()[1], elsewhere)
    for request, frame, key in zip(requests, frames, before, strict=False):
        if engine.picture_key(request) == key:
            same = engine.capture((request,))[0]
            equal = np.array_equal(same.rgb, frame.rgb) and same.info.boxes == frame.info.boxes
            require(equal, f"picture_key: picture {request.frame} differs, and its key is equal")


def check_close(case: EngineCase) -> None:
    """Check that `close` works after a run, a second time, and before a reset."""
    with engine_of(case):
        pass
    with engine_of(case) as engine:
        reset(engine, case)
        engine.close()


ENGINE_CHECKS: tuple[Callable[[EngineCase], None], ...] = (
    check_commands,
    check_ready,
    check_admission,
    check_refusals,
    check_arguments,
    check_busy,
    check_advance,
    check_receipts,
    check_preemption,
    check_strangers,
    check_repeatable,
    check_cuts,
    check_values,
    check_words,
    check_speed,
    check_options,
    check_fork,
    check_capture,
    check_close,
)
"""Every check of an engine, in the order of the contract."""


def _rest(engine: Engine, case: EngineCase, start: float, times: Sequence[float]) -> bytes:
    return hashlib.sha256(msgspec.msgpack.encode(advance(engine, case, start, times))).digest()


def _digest(run: Run) -> bytes:
    return hashlib.sha256(msgspec.msgpack.encode((run.ready, run.admissions, run.boundaries))).digest()


def _close(state: BodyState, other: BodyState) -> bool:
    numbers = ((*body.position, *body.velocity, body.pitch_deg, body.roll_deg) for body in (state, other))
    return state.status == other.status and all(
        abs(a - b) <= _TOLERANCE * max(1.0, abs(a)) for a, b in zip(*numbers, strict=True)
    )


def _frame(request: CaptureRequest, frame: Frame, camera: CameraSpec) -> None:
    what, info = f"capture: picture {request.frame}", frame.info
    got = (info.id, info.entity, info.camera, info.tick)
    require(
        got == (request.frame, request.entity, request.camera, request.tick),
        f"{what} answers {got}",
    )
    size = (camera.height, camera.width)
    require(frame.rgb.shape == (*size, 3) and frame.rgb.dtype == "uint8", f"{what}: rgb is not a uint8 {size} picture")
    require((frame.depth is not None) == ("depth" in camera.channels), f"{what}: depth is not as declared")
    require((frame.semantic is not None) == ("semantic" in camera.channels), f"{what}: semantic is not as declared")
    require((frame.instance is not None) == ("instance" in camera.channels), f"{what}: instance is not as declared")
    require(frame.depth is None or frame.depth.shape == size, f"{what}: depth has another size")
    require(frame.semantic is None or frame.semantic.shape == size, f"{what}: semantic has another size")
    require(frame.instance is None or frame.instance.shape == size, f"{what}: instance has another size")
    for box in info.boxes:
        left, top, right, bottom = box.box
        ordered = 0.0 <= left < right <= 1.0 and 0.0 <= top < bottom <= 1.0
        require(ordered and box.pixels > 0, f"{what}: the box of `{box.entity}` is {box.box} with {box.pixels} pixels")


__all__ = [
    "ENGINE_CHECKS", "check_advance", "check_capture", "check_close", "check_cuts", "check_engine", "check_fork",
    "check_options", "check_ready", "check_repeatable", "check_strangers", "check_values",
]  # fmt: skip
