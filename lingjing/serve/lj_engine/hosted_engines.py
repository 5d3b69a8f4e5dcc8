"""Our engines for a backend that is a process of this project: the five methods, called over the wire."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from lingjing.decoding import converted
from lingjing.engines.remote.exact import AdvanceCall, ResetCall, SubmitCall
from lingjing.engines.remote.messages import EXTENSION, EXTENSION_VERSION, Document
from lingjing.errors import LingjingError, UsageError
from lingjing.mission.instance import SceneSpec
from lingjing.mission.schedule import Schedule
from lingjing.plugins.building import build_city
from lingjing.plugins.engine import Engine, EngineSpec
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City, content_sha256


class HostedEngines:
    """The engines of one episode of such a backend."""

    def __init__(self, host: PluginHost, names: Iterable[str]) -> None:
        """`names` are the engines that may be hosted."""
        self._host, self.names = host, tuple(names)
        self._engines: dict[str, Engine] = {}
        self._schedules: dict[str, Schedule] = {}
        self._city: tuple[SceneSpec, City] | None = None

    def offer(self) -> Document:
        """Return the field `lingjing` of an acknowledgement of a reset."""
        return {"version": EXTENSION_VERSION, "engines": list(self.names)}

    def observe(self, extension: Document, phase: str) -> Document:
        """Carry out `reset` or `advance`, and return the data of the response."""
        if phase == "reset":
            return self._answer(boundary=self._reset(converted(extension, ResetCall)))
        call = converted(extension, AdvanceCall)
        self._schedules[call.engine].update(call.occurrences)
        return self._answer(boundary=self._engine(call.engine).advance(call.until, call.mirrors))

    def act(self, extension: Document) -> Document:
        """Carry out `submit`, and return the data of the acknowledgement."""
        call = converted(extension, SubmitCall)
        return self._answer(receipts=tuple(self._engine(call.engine).submit(call.commands)))

    def close(self) -> None:
        """Close all engines."""
        engines, self._engines = self._engines, {}
        for engine in engines.values():
            engine.close()

    def _reset(self, call: ResetCall) -> object:
        if call.engine not in self.names:
            raise UsageError(f"the engine `{call.engine}` is not hosted here")
        city = self._built(call.instance.scene)
        if content_sha256(city) != call.city_sha256:
            raise UsageError("the city differs from that of the backend: compare the map, the plug-in and the version")
        earlier = self._engines.pop(call.engine, None)
        if earlier is not None:
            earlier.close()
        engine = self._engines[call.engine] = self._host.engine(call.engine).factory()
        schedule = self._schedules[call.engine] = Schedule(call.instance)
        spec = EngineSpec(engine=call.engine, instance=call.instance, owns=call.owns, events=schedule)
        return engine.reset(spec, city, call.seed)

    def _built(self, scene: SceneSpec) -> City:
        if self._city is None or self._city[0] != scene:
            self._city = scene, build_city(scene, self._host)
        return self._city[1]

    def _engine(self, name: str) -> Engine:
        if name not in self._engines:
            raise LingjingError(f"the engine `{name}` was not reset")
        return self._engines[name]

    def _answer(self, **content: object) -> Mapping[str, object]:
        return {"status": "ok", EXTENSION: content}
