"""The sources of frames: named traces, and development episodes that are played for the set."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import msgspec
import PIL.Image

from lingjing.bench.frame_sets.labelled import LabelledFrame, labelled_frames
from lingjing.errors import UsageError
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeTask, play_apart
from lingjing.play.report import ABORTED, INTERRUPTED
from lingjing.trace.reader import Trace, read_trace

TRACE = "trace.mcap"
"""The file name of a complete trace."""


class FrameSources:
    """The labelled frames of traces, and their pictures by name. An episode that is named twice counts once."""

    def __init__(self, paths: Iterable[Path]) -> None:
        self.frames: list[LabelledFrame] = []
        self._traces: dict[str, Trace] = {}
        for path in paths:
            trace = read_trace(path)
            fresh = [frame for frame in labelled_frames(trace) if frame.name not in self._traces]
            self.frames += fresh
            self._traces |= dict.fromkeys((frame.name for frame in fresh), trace)
        self._ids = {frame.name: frame.frame for frame in self.frames}

    def jpeg(self, name: str) -> bytes:
        """Return the stored picture of a frame."""
        return self._traces[name].jpeg(self._ids[name])

    def mask(self, name: str) -> bytes | None:
        """Return the instance mask of a frame as a PNG of 16 bits; None if its camera stores none.

        It holds what the camera recorded: hidden targets are drawn into no mask.
        """
        numbers = self._traces[name].picture(self._ids[name]).instance
        if numbers is None:
            return None
        file = io.BytesIO()
        PIL.Image.fromarray(numbers).save(file, "PNG")
        return file.getvalue()


def found_traces(places: Iterable[Path]) -> list[Path]:
    """Return the named trace files, and every `trace.mcap` below the named folders. Raises `UsageError` for a place
    without one.
    """
    traces: list[Path] = []
    for place in places:
        below = sorted(place.rglob(TRACE)) if place.is_dir() else [place]
        if not below or not all(path.is_file() for path in below):
            raise UsageError(
                f"`{place}` is neither a trace nor a folder with traces", hint=f"name a {TRACE} or its folder"
            )
        traces += below
    return list(dict.fromkeys(traces))


def played(options: Sequence[PlayOptions], folder: Path, jobs: int) -> Iterator[Path]:
    """Yield the traces of episodes, which are played unless the folder has them complete. Aborted ones are left out."""
    tasks: list[EpisodeTask] = []
    for episode in options:
        place = folder / f"{Path(episode.mission).stem}-{episode.mode or 'default'}-{episode.seed}"
        if (place / TRACE).is_file():
            _check_same(read_trace(place / TRACE), episode)
            yield place / TRACE
        else:
            for left in place.glob(f"{TRACE}.part"):
                left.unlink()
            tasks.append(EpisodeTask(msgspec.structs.replace(episode, overview=False), place))
    for _, report in play_apart(tasks, jobs):
        if report.reason not in (ABORTED, INTERRUPTED):
            yield Path(report.trace)


def _check_same(trace: Trace, options: PlayOptions) -> None:
    """Raise `UsageError` for a stored episode that was played with other options."""
    instance = trace.header.instance
    same_policy = {binding.policy for binding in trace.header.bindings} == {options.policy}
    settings = {name: instance.settings.get(name) for name in options.settings}
    if not same_policy or settings != options.settings or instance.seed != options.seed:
        raise UsageError(f"{trace.path} was played with other options", hint="name another folder with --episodes")


__all__ = ["TRACE", "FrameSources", "found_traces", "played"]
