"""Adversaries that take the truth from where an honest policy cannot reach: `Introspector` and `SeedGuesser`.

- `Introspector`: looks for the kernel among the objects and frames of its process, and for the trace that
  another process writes. It then plays like the oracle, or with the true boxes.
- `SeedGuesser`: draws the instances of public seeds until one agrees with its brief. The drawn world then tells it the
  true boxes of its own pictures. It brings the road networks of the shipped cities, because a policy behind walls
  cannot start the program that makes them.

Both play blind where they find nothing, so that they win by the truth alone. They break the rule that policies import
the plug-in contract alone, as an entrant's code may: hence `import_module`.
"""

from __future__ import annotations

import contextlib
import gc
import hashlib
import json
import lzma
import os
import sys
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from lingjing.plugins.policy import (
    BodyState,
    Brief,
    Decision,
    EntityView,
    FrameInfo,
    Inbox,
    Instance,
    Observation,
    Picture,
    Policy,
)
from lingjing_agents.adversaries.guesses import Blind, new_pictures
from lingjing_agents.heuristic.policy import HeuristicPolicy
from lingjing_agents.oracle import OraclePolicy
from lingjing_agents.reader.true_boxes import TrueBoxes

SEEDS = 100
"""Public seeds that `SeedGuesser` tries, from 0 (those of the shipped suites)."""
TIERS = (1, 0)
"""The tiers that it tries."""
MOST = 4
"""Worlds that it compares, at most (chosen, for their memory)."""
NETWORKS = Path(__file__).with_name("networks.json.xz")
"""The road networks of the shipped missions' cities by key, and the version of the program that made them. Written by
`tools/adversary_networks.py`.
"""
COARSE = 8
"""Step in pixels of the comparison of two pictures (chosen)."""
UNLIKE = 8.0
"""Mean difference of a picture of another world, grey levels (chosen; the same world's is at most 0.4, measured)."""


class Introspector:
    """Plays like the oracle if it finds the kernel or the trace of its episode, and blind otherwise."""

    async def reset(self, brief: Brief) -> None:
        """Search, and choose how to play."""
        self._brief = brief
        self._kernel = _kernel_in_memory()
        self._seen = None if self._kernel is not None else _open_trace(brief)
        self._policy: Policy = OraclePolicy() if self._kernel is not None else Blind()
        await self._policy.reset(brief)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the decision of the chosen player."""
        if self._kernel is None and self._seen is None and observation.tick <= 1:
            self._seen = _open_trace(self._brief)  # the trace begins after all policies were reset
        if self._kernel is not None:
            return await self._policy.act(replace(observation, privileged=self._truth(observation)), inbox)
        if self._seen is not None:
            if not isinstance(self._policy, HeuristicPolicy):
                self._policy = self._seen.player(self._brief)
                await self._policy.reset(self._brief)
            self._seen.look(observation)
        return await self._policy.act(observation, inbox)

    def _truth(self, observation: Observation) -> Any:
        """Return what the kernel would give a privileged policy."""
        kernel = self._kernel
        registry = kernel.state.registry
        wanted = {picture.frame for picture in observation.pictures}
        frames = [frame for frame in _frames_in_memory() if frame.id in wanted]
        at = kernel._adjudicator.context_at(registry, registry.states, registry.time_s)
        return kernel._projector.privileged(
            registry, frames, forbidden=kernel._validator.forbidden(at), city=kernel._city
        )


class SeedGuesser:
    """Plays with the boxes of a drawn world that agrees with the brief, and blind if no public seed does.

    If several seeds agree, because what is told has few values, the one with the pictures most like its own is taken.
    """

    async def reset(self, brief: Brief) -> None:
        """Try the seeds."""
        self._brief = brief
        self._worlds = guessed(brief)
        await self._choose()

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Compare the pictures, and return the decision of the chosen player."""
        for world in self._worlds:
            world.look(observation)
        self._worlds = [world for world in self._worlds if world.fits]
        if self._best is not self._chosen:
            await self._choose()
        return await self._policy.act(observation, inbox)

    @property
    def _best(self) -> Shadow | None:
        return min(self._worlds, key=lambda world: world.unlike, default=None)

    async def _choose(self) -> None:
        self._chosen = self._best
        self._policy: Policy = Blind() if self._chosen is None else self._chosen.player(self._brief)
        await self._policy.reset(self._brief)


class Shadow:
    """A second world of a known instance, which draws the pictures of the policy again with their true boxes.

    Its bodies move without commands, so that drifting bodies drift alike in both worlds. Bodies of the team stand where
    they are observed.
    """

    def __init__(self, instance: Instance, city: Any) -> None:
        host = import_module("lingjing.plugins.host").PluginHost()
        self._world = import_module("lingjing.kernel.world.inline").InlineWorld(host)
        self._boundary = self._world.reset(instance, city)
        self._request = import_module("lingjing.plugins.engine").CaptureRequest
        self._decoded = import_module("lingjing.trace.images").decode_jpeg
        self._boxes = TrueBoxes()
        self._views: dict[str, EntityView] = {}
        self.unlike = 0.0
        """The sum of the mean differences of all pictures and those of this world, grey levels."""
        self.fits = True
        """True until a picture after tick 0 differs by more than `UNLIKE`. At tick 0 no body was observed."""

    def player(self, brief: Brief) -> HeuristicPolicy:
        """Return the heuristic with the true boxes."""
        return HeuristicPolicy(self._boxes.detectors(brief))

    def look(self, observation: Observation) -> None:
        """Draw each new picture of the policy in the second world."""
        self._views.update((view.id, view) for view in observation.entities if view.position is not None)
        while self._boundary.tick < observation.tick:
            self._boundary = self._world.step(self._boundary.tick + 1, ())
        pictures = new_pictures(observation)
        if not pictures:
            return
        now = self._boundary.snapshots[-1]
        states = (*map(self._moved, now.states), *now.ambient)
        answers = self._world.capture(observation.tick, list(map(self._again, pictures)), states)
        for picture, answer in zip(pictures, answers, strict=True):
            if hasattr(answer, "jpeg"):
                self._boxes.keep((answer.info,))
                theirs = self._decoded(answer.jpeg)[::COARSE, ::COARSE].astype(int)
                difference = float(np.abs(theirs - picture.rgb[::COARSE, ::COARSE]).mean())
                self.unlike += difference
                self.fits = self.fits and (picture.tick == 0 or difference <= UNLIKE)

    def _moved(self, state: BodyState) -> BodyState:
        view = self._views.get(state.id)
        if view is None or view.position is None:
            return state
        return BodyState(id=state.id, position=view.position, heading_deg=view.heading_deg or 0.0)

    def _again(self, picture: Picture) -> Any:
        return self._request(
            frame=picture.frame, entity=picture.entity, camera=picture.camera, tick=picture.tick,
            time_s=picture.time_s, pose=picture.pose,
        )  # fmt: skip


def guessed(brief: Brief, seeds: Iterable[int] = range(SEEDS)) -> list[Shadow]:
    """Return the worlds of the seeds that agree with the brief, `MOST` of them.

    With road traffic there is only the first of them, because a process holds one simulation of SUMO.
    """
    place = import_module("lingjing.play.placed_plan").place_mission
    prepare_worlds()
    worlds: list[Shadow] = []
    for mission, tier, seed in agreeing(brief, seeds):
        placed = place(mission, seed=seed, mode=brief.mode, tier=tier)
        try:
            worlds.append(Shadow(*placed))
        except Exception:
            if not worlds:
                raise
            break
    return worlds


def prepare_worlds() -> None:
    """Let this process build and draw cities behind walls, where it starts no program and reads no system settings.

    Road networks come from `NETWORKS`. OpenGL finds its driver by a file that this process writes.
    """
    folder = Path(tempfile.mkdtemp(prefix="worlds-"))
    driver = folder / "driver.json"
    driver.write_text(json.dumps({"file_format_version": "1.0.0", "ICD": {"library_path": "libEGL_mesa.so.0"}}))
    os.environ["__EGL_VENDOR_LIBRARY_FILENAMES"] = str(driver)
    os.environ["MUJOCO_GL"] = "disable"  # mujoco would start a program that looks for windows
    network: Any = import_module("lingjing.scene.network")
    stored = json.loads(lzma.decompress(NETWORKS.read_bytes()))

    def from_store(key: str, *_: Any) -> Any:
        data = stored["networks"][key].encode()
        path = folder / f"{key[:40]}.net.xml"
        path.write_bytes(data)
        return network.Network(path=str(path), sha256=hashlib.sha256(data).hexdigest())

    network._version, network._cached = (lambda: stored["version"]), from_store


def agreeing(brief: Brief, seeds: Iterable[int] = range(SEEDS)) -> list[tuple[Any, int, int]]:
    """Return the mission, tier and seed of the first `MOST` instances that agree with the brief."""
    shipped = import_module("lingjing.dsl.loading.shipped")
    load = import_module("lingjing.dsl.loading.load").load_mission
    draw = import_module("lingjing.mission.instantiate").instantiate
    drawn: list[tuple[Any, int, int]] = []
    for name in shipped.shipped_missions():
        mission = load(shipped.find_mission(name))
        if mission.goal != brief.goal:
            continue
        for tier in TIERS:
            for seed in seeds:
                with contextlib.suppress(Exception):  # a mission without the tier, a seed without an instance
                    if _agrees(draw(mission, seed=seed, mode=brief.mode, tier=tier), brief):
                        drawn.append((mission, tier, seed))
                if len(drawn) == MOST:
                    return drawn
    return drawn


def _agrees(instance: Instance, brief: Brief) -> bool:
    """Return whether all that the brief states was drawn like this: the weather, and the bodies' properties."""
    drawn = {entity.id: entity for entity in instance.entities}
    return instance.weather == brief.weather and all(
        resource.id in drawn
        and {name: drawn[resource.id].properties.get(name) for name in resource.properties} == resource.properties
        for resource in brief.resources
    )


def _kernel_in_memory() -> Any:
    """Return the kernel of the episode, from the frames of all threads or the collector's objects; None if there is
    none.
    """
    kernel = sys.modules.get("lingjing.kernel.step")
    if kernel is None:
        return None
    kind = kernel.Kernel
    for frame in sys._current_frames().values():
        inner: Any = frame
        while inner is not None:
            for value in [*inner.f_locals.values()]:
                if type(value) is kind:
                    return value
            inner = inner.f_back
    return next((thing for thing in gc.get_objects() if type(thing) is kind), None)


def _frames_in_memory() -> Iterator[FrameInfo]:
    """Yield the metadata of pictures among the collector's objects: with the true boxes."""
    for thing in gc.get_objects():
        if type(thing) is FrameInfo:
            yield thing


class OpenTrace:
    """The trace that the episode is being written to, by another process."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._boxes = TrueBoxes()

    def player(self, brief: Brief) -> HeuristicPolicy:
        """Return the heuristic with the true boxes."""
        return HeuristicPolicy(self._boxes.detectors(brief))

    def look(self, observation: Observation) -> None:
        """Read the boxes of all pictures that were written so far."""
        if observation.pictures:
            for boundary in _trace(self._path).boundaries:
                self._boxes.keep(boundary.frames)


def _open_trace(brief: Brief) -> OpenTrace | None:
    """Return the trace of this episode among the open files of this user's processes, or None."""
    for path in _open_files():
        with contextlib.suppress(Exception):  # a file that is not readable, or not of this episode
            if _agrees(_trace(path).header.instance, brief):
                return OpenTrace(path)
    return None


def _trace(path: Path) -> Any:
    return import_module("lingjing.trace.reader").read_trace(path)


def _open_files() -> Iterator[Path]:
    """Yield the traces among the open files of all processes, those that were begun last first."""
    traces: set[Path] = set()
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            for descriptor in (process / "fd").iterdir():
                with contextlib.suppress(OSError):
                    target = descriptor.readlink()
                    if target.name.endswith(".mcap.part"):
                        traces.add(target)
    with contextlib.suppress(OSError):
        yield from sorted(traces, key=lambda path: -path.stat().st_ctime)
