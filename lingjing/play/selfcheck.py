"""A tiny episode with a stored digest: whether this machine computes the numbers that every other one does.

`selfcheck.ljs` is played with fixed commands and compared with `selfcheck.json`, which holds the digest, and the
digest of the pictures with the renderer that drew them. Whatever changes what an engine, the kernel or a scene computes
changes them: `python -m lingjing.play.selfcheck` plays it and writes them anew.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import msgspec

from lingjing.errors import ExitCode, InfrastructureError
from lingjing.mission.vocabulary import PHOTO
from lingjing.numerics import withdrawn
from lingjing.play.episode import run
from lingjing.plugins.policy import Action, Brief, Decision, Inbox, Observation
from lingjing.trace.reader import read_trace

MISSION = Path(__file__).with_suffix(".ljs")
STORED = Path(__file__).with_suffix(".json")
SEED = 7

_SCRIPT: dict[str, dict[int, Action]] = {
    "flyer": {
        0: Action(verb="takeoff"),
        2: Action(verb="setDestination", arguments={"x": 40.0, "y": 30.0, "z": 35.0}),
        5: Action(verb=PHOTO),
    },
    "walker": {
        0: Action(verb="right", arguments={"angle": 70.0}),
        1: Action(verb="forward", arguments={"distance": 25.0}),
        5: Action(verb=PHOTO),
    },
    "driver": {0: Action(verb="setDestination", arguments={"x": 0.0, "y": 60.0})},
}


class Computed(msgspec.Struct, frozen=True, kw_only=True):
    """What came of the episode: its digests, who drew the pictures, and the versions of what computed."""

    digest: str
    frames_digest: str
    renderer: str
    versions: dict[str, str]


class SelfCheck(msgspec.Struct, frozen=True, kw_only=True):
    """`computed` here against `stored`; `processes` holds each process's `lingjing.numerics.runtime_fingerprint`."""

    computed: Computed
    stored: Computed
    processes: dict[str, dict[str, str]]

    @property
    def agrees(self) -> bool:
        """Whether the digests are equal, that of the pictures only if the same renderer drew them."""
        same_pictures = self.computed.frames_digest == self.stored.frames_digest
        return self.computed.digest == self.stored.digest and (same_pictures or not self.is_same_renderer)

    @property
    def is_same_renderer(self) -> bool:
        """Whether the pictures can be compared."""
        return self.computed.renderer == self.stored.renderer

    @property
    def suspects(self) -> tuple[str, ...]:
        """What is known to be otherwise than where the digest was stored."""
        ours, theirs = self.computed.versions, self.stored.versions
        names = sorted(name for name in {*ours, *theirs} if ours.get(name) != theirs.get(name))
        other = (f"{name} is {ours.get(name, 'absent')}, was {theirs.get(name, 'absent')}" for name in names)
        return (*withdrawn(self.processes), *other)


class Scripted:
    """A policy that gives fixed commands at fixed ticks."""

    async def reset(self, brief: Brief) -> None:
        """Take the part of this agent."""
        self._part: Mapping[int, Action] = _SCRIPT[brief.role]

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """The command of this tick, if there is one."""
        return Decision(command=self._part.get(observation.tick))


def check() -> SelfCheck:
    """Play the episode and compare. Raises `InfrastructureError` if it is aborted, or nothing is stored."""
    try:
        stored = msgspec.json.decode(STORED.read_bytes(), type=Computed)
    except (OSError, msgspec.DecodeError) as error:
        raise InfrastructureError(f"`{STORED}` cannot be read: {error}", hint="reinstall lingjing") from error
    computed, processes = _play()
    return SelfCheck(computed=computed, stored=stored, processes=processes)


def _play() -> tuple[Computed, dict[str, dict[str, str]]]:
    with tempfile.TemporaryDirectory(prefix="lingjing-selfcheck-") as folder:
        result = run(MISSION, policy=Scripted, seed=SEED, out=Path(folder, "run"), overview=False)
        if result.reason == "infrastructure-abort":
            raise InfrastructureError(f"the stored episode was aborted: {result.detail}", hint=result.hint)
        trace = read_trace(result.trace)
    renderer = next((frame.renderer for record in trace.boundaries for frame in record.frames), "")
    processes = trace.outcome.processes if trace.outcome is not None else {}
    computed = Computed(
        digest=result.digest, frames_digest=result.frames_digest, renderer=renderer, versions=trace.header.fingerprint
    )
    return computed, processes


def main() -> int:
    """Play the episode and store what came of it; refused in a process that the promise does not hold for."""
    computed, processes = _play()
    if withdrawn(processes):
        print("not stored:", *withdrawn(processes), sep="\n  ", file=sys.stderr)  # noqa: T201
        return ExitCode.INFRASTRUCTURE
    STORED.write_bytes(msgspec.json.format(msgspec.json.encode(computed), indent=2) + b"\n")
    print(f"stored {computed.digest[:16]} in {STORED}")  # noqa: T201
    return ExitCode.OK


if __name__ == "__main__":
    sys.exit(main())
