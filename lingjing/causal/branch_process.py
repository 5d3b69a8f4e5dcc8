"""`python -m lingjing.causal.branch_process`: holds an episode at its boundaries and forks a branch for each question.

Started by `branch_host` alone. One process drives the episode on and leaves, at each boundary that is wanted, a copy of
itself that stands still; a branch is a fork of such a copy. So a branch costs a fork and its own ticks, whichever
boundary it leaves from. All of them have one thread; a fork of a process with several is refused. Each ends with the
process that it was forked from, and the first of them with its caller.
"""

from __future__ import annotations

import argparse
import gc
import os
import signal
import socket
import sys
import time
import traceback
from typing import NoReturn

import msgspec

from lingjing.causal.branch_queue import BranchQueue, introduce
from lingjing.causal.branching import BranchResult, play_branch
from lingjing.causal.interventions import BranchPlan
from lingjing.causal.processor_time import cpu_of
from lingjing.causal.redriven import BranchOptions, RedrivenEpisode
from lingjing.errors import ExitCode, InfrastructureError, LingjingError, UsageError
from lingjing.processes.channel import Channel, ChannelClosedError
from lingjing.processes.linux import SeveralThreadsError, end_with_parent, fork
from lingjing.terminal import guard_streams

HELD_MOST = 32
"""So many boundaries are held at once at most, each of which takes 20 to 130 MB; then every second one is let go, and
branches drive on to theirs."""


class HostMessage(msgspec.Struct, frozen=True, kw_only=True, tag=True, tag_field="is"):
    """Base of what a branch host and its process say to each other."""


class OpenTrace(HostMessage, frozen=True, kw_only=True):
    """Read a trace and stand at its boundary 0."""

    options: BranchOptions


class DriveOn(HostMessage, frozen=True, kw_only=True):
    """Drive on to the last boundary and hold all on the way."""


class PlayBranches(HostMessage, frozen=True, kw_only=True):
    """Play these branches; those `ahead` may be asked for next, and idle workers may begin with them."""

    plans: tuple[BranchPlan, ...]
    ahead: tuple[BranchPlan, ...] = ()


class TraceOpened(HostMessage, frozen=True, kw_only=True):
    """The episode stands at boundary 0; these agents ask chat models."""

    models: tuple[str, ...] = ()


class DrivenTo(HostMessage, frozen=True, kw_only=True):
    """A boundary was reached."""

    boundary: int


class EpisodeDriven(HostMessage, frozen=True, kw_only=True):
    """The last boundary was reached. `departures` are the boundaries at which agents decided otherwise than their
    references, by faculty and agent, `agreements` those at which they decided something and it was right; `cpu_s` is
    what the process has taken so far."""

    departures: tuple[tuple[str, str, tuple[int, ...]], ...]
    agreements: tuple[tuple[str, str, tuple[int, ...]], ...]
    cpu_s: float


class BranchPlayed(HostMessage, frozen=True, kw_only=True):
    """Branch `index` of those asked for has ended. `camera_s` is what drawing has taken so far, `unused_s` what was
    spent on those begun ahead for nothing."""

    index: int
    result: BranchResult
    camera_s: float
    unused_s: float = 0.0


class HostFailed(HostMessage, frozen=True, kw_only=True):
    """What was asked for cannot be done; `exit_code` is that of the error."""

    message: str
    hint: str = ""
    exit_code: int = ExitCode.USAGE


HostRequest = OpenTrace | DriveOn | PlayBranches
HostReply = TraceOpened | DrivenTo | EpisodeDriven | BranchPlayed | HostFailed


def main() -> None:
    """Serve one caller until it is gone."""
    parser = argparse.ArgumentParser(prog="lingjing.causal.branch_process")
    parser.add_argument("--fd", type=int, required=True)
    parser.add_argument("--parent", type=int, required=True)
    options = parser.parse_args()
    end_with_parent(options.parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    guard_streams()
    os.set_inheritable(options.fd, False)
    _Server(Channel(socket.socket(fileno=options.fd))).run()
    _write_out()
    os._exit(0)  # no shutdown of the interpreter: what its policies left behind is not to hold it up


class _Server:
    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._episode: RedrivenEpisode | None = None
        self._queue: BranchQueue | None = None
        self._held: dict[int, Channel] = {}

    def run(self) -> None:
        decoder: msgspec.msgpack.Decoder[HostRequest] = msgspec.msgpack.Decoder(HostRequest)
        try:
            while True:
                self._attempt(decoder.decode(self._channel.receive().payload))
        except ChannelClosedError:
            return

    def _attempt(self, request: HostRequest) -> None:
        try:
            self._answer(request)
        except ChannelClosedError:
            raise
        except LingjingError as error:
            self._say(HostFailed(message=str(error), hint=error.hint, exit_code=error.exit_code))
        except SeveralThreadsError as error:
            self._say(_refusal_of_threads(error))
        except Exception as error:  # noqa: BLE001 - a fault of ours, which the caller raises
            traceback.print_exc()
            said = f"the branch host failed: {type(error).__name__}: {error}"
            self._say(HostFailed(message=said, exit_code=ExitCode.BUG))

    def _answer(self, request: HostRequest) -> None:
        if isinstance(request, OpenTrace):
            self._episode = RedrivenEpisode(request.options)
            self._queue = BranchQueue(self._begin, request.options.jobs)
            gc.collect()
            gc.freeze()  # what is there now stays: collections need not touch the pages that forks share
            self._hold()
            self._say(TraceOpened(models=self._episode.models))
            return
        if self._episode is None or self._queue is None:
            raise UsageError("no trace is open")
        if isinstance(request, DriveOn):
            self._drive_to(self._episode.last, None)
            departed, agreed = (
                tuple((*pair, tuple(ticks)) for pair, ticks in found.items())
                for found in (self._episode.departures, self._episode.agreements)
            )
            self._say(EpisodeDriven(departures=departed, agreements=agreed, cpu_s=time.process_time()))
        else:
            self._play(self._queue, request)

    def _say(self, message: HostMessage) -> None:
        self._channel.send(msgspec.msgpack.encode(message))

    def _drive_to(self, boundary: int, wanted: frozenset[int] | None) -> None:
        """On to a boundary; those that are `wanted` are held, or all."""
        episode = self._episode
        assert episode is not None
        while episode.tick < boundary:
            episode.advance()
            self._say(DrivenTo(boundary=episode.tick))
            if wanted is None or episode.tick in wanted:
                self._hold()

    # -- boundaries that are held

    def _hold(self) -> None:
        """Leave a copy of this process at the boundary that was reached."""
        assert self._episode is not None
        if len(self._held) >= HELD_MOST:
            for boundary in list(self._held)[1::2]:
                self._held.pop(boundary).close()
        ours, theirs = socket.socketpair()
        parent = os.getpid()
        _write_out()
        with theirs:
            if fork(keep_random=True) == 0:
                ours.close()
                self._stand_still(Channel(theirs), parent)
        self._held[self._episode.tick] = Channel(ours)

    def _stand_still(self, requests: Channel, parent: int) -> NoReturn:
        try:
            end_with_parent(parent)
            for end in self._held.values():
                end.close()
            signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # ended branches are nobody's zombies
            while True:
                packet = requests.receive()
                self._fork_branch(msgspec.msgpack.decode(packet.payload, type=BranchPlan), packet.descriptors[0])
        except ChannelClosedError:
            os._exit(0)
        finally:
            os._exit(0)

    def _fork_branch(self, plan: BranchPlan, output: int) -> None:
        parent, before = os.getpid(), time.process_time()
        if fork(keep_random=True) == 0:
            fork_s = cpu_of(parent) - before
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            self._be_branch(plan, output, fork_s, parent)
        os.close(output)

    def _be_branch(self, plan: BranchPlan, output: int, fork_s: float, parent: int) -> NoReturn:
        try:
            end_with_parent(parent)
            started = time.process_time()
            channel = Channel(socket.socket(fileno=output))
            introduce(channel)
            result = self._played(plan)
            spent = time.process_time() - started + fork_s
            channel.send(msgspec.msgpack.encode(msgspec.structs.replace(result, cpu_s=spent, fork_s=fork_s)))
        finally:
            _write_out()
            os._exit(0)

    def _played(self, plan: BranchPlan) -> BranchResult:
        assert self._episode is not None
        try:
            return play_branch(self._episode, plan)
        except LingjingError as error:
            return BranchResult(failed=str(error), hint=error.hint, exit_code=error.exit_code)
        except Exception as error:  # noqa: BLE001 - told to the caller, who raises it
            traceback.print_exc()
            return BranchResult(failed=f"the branch failed: {type(error).__name__}: {error}", exit_code=ExitCode.BUG)

    # -- branches

    def _play(self, queue: BranchQueue, request: PlayBranches) -> None:
        wanted = frozenset(plan.at for plan in request.plans)
        self._drive_to(max(wanted, default=0), wanted)
        try:
            queue.play(request.plans, request.ahead, self._tell)
        except BaseException:
            queue.close()
            raise

    def _tell(self, index: int, result: BranchResult) -> None:
        assert self._episode is not None and self._queue is not None
        camera_s, unused_s = self._episode.camera.cpu_s, self._queue.unused_s
        self._say(BranchPlayed(index=index, result=result, camera_s=camera_s, unused_s=unused_s))

    def _begin(self, plan: BranchPlan) -> Channel:
        """Ask the nearest boundary before the branch for it; where its result is to be read. `InfrastructureError` if
        the process that holds it has ended."""
        boundary = max(one for one in self._held if one <= plan.at)
        ours, theirs = socket.socketpair()
        with theirs:
            try:
                self._held[boundary].send(msgspec.msgpack.encode(plan), (theirs.fileno(),))
            except ChannelClosedError as error:
                ours.close()
                raise InfrastructureError(
                    f"the process that holds boundary {boundary} for branches has ended", hint="it was killed"
                ) from error
        return Channel(ours)


def _write_out() -> None:
    """Write what policies have printed: a fork would print it once more."""
    sys.stdout.flush()
    sys.stderr.flush()


def _refusal_of_threads(error: SeveralThreadsError) -> HostFailed:
    more = error.count - 1
    return HostFailed(
        message=f"the episode cannot be branched: its policies keep {more} more thread{'s' * (more > 1)}, "
        "and a thread has no copy",
        hint="a policy that is to be branched runs in the thread that asks it",
    )


if __name__ == "__main__":
    main()
