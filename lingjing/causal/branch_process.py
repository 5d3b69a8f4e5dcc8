"""The branch server (`python -m lingjing.causal.branch_process`): holds an episode and forks a process for each
branch.

`branch_host` starts it. The first process drives the episode through its boundaries and leaves, at each boundary that
is needed, a waiting copy of itself. A branch is a fork of such a copy, so it costs a fork and its own ticks,
independent of the boundary. All processes have one thread; forks with several threads are refused. Each process ends
with its parent, and the first one with its client.
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
from lingjing.decoding import MsgpackDecoder, from_msgpack, msgpack_decoder
from lingjing.errors import ExitCode, InfrastructureError, LingjingError, UsageError, hint_of
from lingjing.processes.channel import Channel, ChannelClosedError
from lingjing.processes.linux import SeveralThreadsError, end_with_parent, fork
from lingjing.processes.signals import leave_interrupts_to_parent
from lingjing.terminal import guard_streams

HELD_MOST = 32
"""The greatest number of waiting copies; each takes 20 to 130 MB (measured). Above it every second copy is closed, and
branches replay from the copy before. Chosen.
"""


class HostMessage(msgspec.Struct, frozen=True, kw_only=True, tag=True, tag_field="is"):
    """Base of the messages between a branch host and its server."""


class OpenTrace(HostMessage, frozen=True, kw_only=True):
    """Read a trace and go to its boundary 0."""

    options: BranchOptions


class DriveOn(HostMessage, frozen=True, kw_only=True):
    """Drive to the last boundary and hold all boundaries on the way."""


class PlayBranches(HostMessage, frozen=True, kw_only=True):
    """Play these branches."""

    plans: tuple[BranchPlan, ...]
    ahead: tuple[BranchPlan, ...] = ()
    """Plans that may be requested next; idle workers may begin with them."""


class TraceOpened(HostMessage, frozen=True, kw_only=True):
    """The episode is at boundary 0."""

    models: tuple[str, ...] = ()
    """Agents with policies that call chat models."""


class DrivenTo(HostMessage, frozen=True, kw_only=True):
    """A boundary was reached."""

    boundary: int


class EpisodeDriven(HostMessage, frozen=True, kw_only=True):
    """The last boundary was reached."""

    departures: tuple[tuple[str, str, tuple[int, ...]], ...]
    """Boundaries of departures by faculty and agent."""
    agreements: tuple[tuple[str, str, tuple[int, ...]], ...]
    """Boundaries of agreements by faculty and agent."""
    cpu_s: float
    """CPU time of the server so far, seconds."""


class BranchPlayed(HostMessage, frozen=True, kw_only=True):
    """A branch has ended."""

    index: int
    """The number of its plan in the request."""
    result: BranchResult
    camera_s: float
    """CPU time of the camera so far, seconds."""
    unused_s: float = 0.0
    """CPU time of unused branches ahead so far, seconds."""


class HostFailed(HostMessage, frozen=True, kw_only=True):
    """The answer to a request that failed."""

    message: str
    hint: str = ""
    exit_code: int = ExitCode.USAGE
    """The exit code of the error."""


HostRequest = OpenTrace | DriveOn | PlayBranches
"""Messages to the server."""

HostReply = TraceOpened | DrivenTo | EpisodeDriven | BranchPlayed | HostFailed
"""Messages from the server."""


def main() -> None:
    """Serve one client until it closes the connection."""
    parser = argparse.ArgumentParser(prog="lingjing.causal.branch_process")
    parser.add_argument("--fd", type=int, required=True)
    parser.add_argument("--parent", type=int, required=True)
    options = parser.parse_args()
    end_with_parent(options.parent)
    leave_interrupts_to_parent()
    guard_streams()
    os.set_inheritable(options.fd, False)
    _Server(Channel(socket.socket(fileno=options.fd))).run()
    _flush_streams()
    os._exit(0)  # without a shutdown of the interpreter, which threads or objects of policies could block


class _Server:
    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._episode: RedrivenEpisode | None = None
        self._queue: BranchQueue | None = None
        self._held: dict[int, Channel] = {}

    def run(self) -> None:
        decoder: MsgpackDecoder[HostRequest] = msgpack_decoder(HostRequest)
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
            self._send(HostFailed(message=str(error), hint=hint_of(error), exit_code=error.exit_code))
        except SeveralThreadsError as error:
            self._send(_threads_error(error))
        except Exception as error:  # noqa: BLE001 - a bug, which the client raises
            traceback.print_exc()
            message = f"the branch host failed: {type(error).__name__}: {error}"
            self._send(HostFailed(message=message, exit_code=ExitCode.BUG))

    def _answer(self, request: HostRequest) -> None:
        if isinstance(request, OpenTrace):
            self._episode = RedrivenEpisode(request.options)
            self._queue = BranchQueue(self._start_branch, request.options.jobs)
            gc.collect()
            gc.freeze()  # collections skip existing objects and so do not copy pages shared with forks
            self._hold()
            self._send(TraceOpened(models=self._episode.models))
            return
        if self._episode is None or self._queue is None:
            raise UsageError("no trace is open")
        if isinstance(request, DriveOn):
            self._drive_to(self._episode.last, None)
            departed, agreed = (
                tuple((*pair, tuple(ticks)) for pair, ticks in boundaries_of.items())
                for boundaries_of in (self._episode.departures, self._episode.agreements)
            )
            self._send(EpisodeDriven(departures=departed, agreements=agreed, cpu_s=time.process_time()))
        else:
            self._play(self._queue, request)

    def _send(self, message: HostMessage) -> None:
        self._channel.send(msgspec.msgpack.encode(message))

    def _drive_to(self, boundary: int, held: frozenset[int] | None) -> None:
        """Drive to a boundary; hold the boundaries in `wanted` on the way, or all."""
        episode = self._episode
        assert episode is not None
        while episode.tick < boundary:
            episode.advance()
            self._send(DrivenTo(boundary=episode.tick))
            if held is None or episode.tick in held:
                self._hold()

    # -- held boundaries

    def _hold(self) -> None:
        """Leave a waiting copy of this process at the current boundary."""
        assert self._episode is not None
        if len(self._held) >= HELD_MOST:
            for boundary in list(self._held)[1::2]:
                self._held.pop(boundary).close()
        ours, theirs = socket.socketpair()
        parent = os.getpid()
        _flush_streams()
        with theirs:
            if fork(keep_random=True) == 0:
                ours.close()
                self._serve_forks(Channel(theirs), parent)
        self._held[self._episode.tick] = Channel(ours)

    def _serve_forks(self, requests: Channel, parent: int) -> NoReturn:
        try:
            end_with_parent(parent)
            for end in self._held.values():
                end.close()
            signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # the system reaps ended branches
            while True:
                packet = requests.receive()
                self._fork_branch(from_msgpack(packet.payload, BranchPlan), packet.descriptors[0])
        except ChannelClosedError:
            os._exit(0)
        finally:
            os._exit(0)

    def _fork_branch(self, plan: BranchPlan, output: int) -> None:
        parent, before = os.getpid(), time.process_time()
        if fork(keep_random=True) == 0:
            fork_s = cpu_of(parent) - before
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            self._run_branch(plan, output, fork_s, parent)
        os.close(output)

    def _run_branch(self, plan: BranchPlan, output: int, fork_s: float, parent: int) -> NoReturn:
        try:
            end_with_parent(parent)
            started = time.process_time()
            channel = Channel(socket.socket(fileno=output))
            introduce(channel)
            result = self._played(plan)
            spent = time.process_time() - started + fork_s
            channel.send(msgspec.msgpack.encode(msgspec.structs.replace(result, cpu_s=spent, fork_s=fork_s)))
        finally:
            _flush_streams()
            os._exit(0)

    def _played(self, plan: BranchPlan) -> BranchResult:
        assert self._episode is not None
        try:
            return play_branch(self._episode, plan)
        except LingjingError as error:
            return BranchResult(failed=str(error), hint=hint_of(error), exit_code=error.exit_code)
        except Exception as error:  # noqa: BLE001 - reported to the client, which raises it
            traceback.print_exc()
            return BranchResult(failed=f"the branch failed: {type(error).__name__}: {error}", exit_code=ExitCode.BUG)

    # -- branches

    def _play(self, queue: BranchQueue, request: PlayBranches) -> None:
        wanted = frozenset(plan.at for plan in request.plans)
        self._drive_to(max(wanted, default=0), wanted)
        try:
            queue.play(request.plans, request.ahead, self._report)
        except BaseException:
            queue.close()
            raise

    def _report(self, index: int, result: BranchResult) -> None:
        assert self._episode is not None and self._queue is not None
        camera_s, unused_s = self._episode.camera.cpu_s, self._queue.unused_s
        self._send(BranchPlayed(index=index, result=result, camera_s=camera_s, unused_s=unused_s))

    def _start_branch(self, plan: BranchPlan) -> Channel:
        """Request a branch from the nearest held boundary, and return the channel of its result.

        Raises `InfrastructureError` if the process of that boundary has ended.
        """
        boundary = max(held for held in self._held if held <= plan.at)
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


def _flush_streams() -> None:
    """Flush standard streams: a fork would print buffered output a second time."""
    sys.stdout.flush()
    sys.stderr.flush()


def _threads_error(error: SeveralThreadsError) -> HostFailed:
    more = error.count - 1
    return HostFailed(
        message=f"the episode cannot be branched: its policies run {more} more thread{'s' * (more > 1)}, "
        "and a fork does not copy threads",
        hint="a policy can be branched if it runs in the calling thread only",
    )


if __name__ == "__main__":
    main()
