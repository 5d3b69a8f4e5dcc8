"""A tiny episode with a stored digest: it tests if this machine computes the same numbers as others.

`selfcheck.ljs` is played with fixed commands. `selfcheck.json` holds the expected digest, and the digest of the
pictures with the renderer that drew them. A change of what an engine, the kernel or a scene computes changes them;
`python -m lingjing.play.selfcheck` then plays the episode and writes them anew.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import msgspec

from lingjing.decoding import from_json
from lingjing.errors import ExitCode, InfrastructureError
from lingjing.mission.vocabulary import PHOTO
from lingjing.numerics import withdrawn
from lingjing.play.episode import run
from lingjing.plugins.policy import Action, Brief, Decision, Inbox, Observation
from lingjing.trace.reader import read_trace

MISSION = Path(__file__).with_suffix(".ljs")
"""The mission of the episode."""
STORED = Path(__file__).with_suffix(".json")
"""The file with the stored result."""
SEED = 7
"""The seed of the instance. Chosen."""

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
"""The commands by role and tick."""


class Computed(msgspec.Struct, frozen=True, kw_only=True):
    """The result of the episode."""

    digest: str
    """The digest of the boundaries, hex."""
    frames_digest: str
    """The digest of the pictures, hex."""
    renderer: str
    """The renderer that drew the pictures; "" without pictures."""
    versions: dict[str, str]
    """The versions of the libraries that computed it."""


class SelfCheck(msgspec.Struct, frozen=True, kw_only=True):
    """The comparison of the result on this machine with the stored one."""

    computed: Computed
    """The result on this machine."""
    stored: Computed
    """The stored result."""
    processes: dict[str, dict[str, str]]
    """The `lingjing.numerics.runtime_fingerprint` of each process."""

    @property
    def agrees(self) -> bool:
        """True if the digests are equal. The digest of the pictures counts only if the same renderer drew them."""
        same_pictures = self.computed.frames_digest == self.stored.frames_digest
        return self.computed.digest == self.stored.digest and (same_pictures or not self.is_same_renderer)

    @property
    def is_same_renderer(self) -> bool:
        """True if the pictures can be compared."""
        return self.computed.renderer == self.stored.renderer

    @property
    def suspects(self) -> tuple[str, ...]:
        """Known differences from the machine that stored the digest."""
        ours, theirs = self.computed.versions, self.stored.versions
        names = sorted(name for name in {*ours, *theirs} if ours.get(name) != theirs.get(name))
        other = (f"{name} is {ours.get(name, 'absent')}, was {theirs.get(name, 'absent')}" for name in names)
        return (*withdrawn(self.processes), *other)


class Scripted:
    """A policy with fixed commands at fixed ticks."""

    async def reset(self, brief: Brief) -> None:
        """Choose the commands of the agent's role."""
        self._part: Mapping[int, Action] = _SCRIPT[brief.role]

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the command of this tick, if there is one."""
        return Decision(command=self._part.get(observation.tick))


def check() -> SelfCheck:
    """Play the episode and compare. Raises `InfrastructureError` if it is aborted, or there is no stored result."""
    try:
        stored = from_json(STORED.read_bytes(), Computed)
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
    """Play the episode and store its result. Returns `ExitCode.INFRASTRUCTURE` if this process's numbers may
    deviate."""
    computed, processes = _play()
    if withdrawn(processes):
        print("not stored:", *withdrawn(processes), sep="\n  ", file=sys.stderr)  # noqa: T201
        return ExitCode.INFRASTRUCTURE
    STORED.write_bytes(msgspec.json.format(msgspec.json.encode(computed), indent=2) + b"\n")
    print(f"stored {computed.digest[:16]} in {STORED}")  # noqa: T201
    return ExitCode.OK


if __name__ == "__main__":
    sys.exit(main())
