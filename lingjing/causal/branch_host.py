"""The client of the branch server, a process that holds an episode and plays branches of it."""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Callable, Sequence
from typing import Self, TypeVar

import msgspec

from lingjing.causal.branch_process import (
    BranchPlayed,
    DrivenTo,
    DriveOn,
    EpisodeDriven,
    HostFailed,
    HostMessage,
    HostReply,
    OpenTrace,
    PlayBranches,
    TraceOpened,
)
from lingjing.causal.branching import BranchResult
from lingjing.causal.interventions import BranchPlan, check, check_trace
from lingjing.causal.redriven import BranchOptions
from lingjing.decoding import from_msgpack
from lingjing.errors import InfrastructureError, UsageError, error_of
from lingjing.kernel.world.launch import ENGINE_VARIABLES
from lingjing.processes.channel import Channel, ChannelClosedError
from lingjing.processes.fork_client import environment, start_to_last
from lingjing.trace.reader import Trace

HostProgress = Callable[[str, int, int], None]
"""Receives the current work, and the numbers of done and of all items."""

ReplyT = TypeVar("ReplyT", bound=HostMessage)


class BranchHost:
    """A context manager for the branches of one trace. Raises `UsageError` with the reason if the trace cannot be
    branched.

    `played`, `cpu_s` and `pictures` count all branches; `driven_s` is the CPU time of the replay, `camera_s` that of
    the camera, `unused_s` that of unused branches ahead. `agreements`, known after `departures`, are boundaries by
    (faculty, agent) at which an agent decided as its reference.
    """

    def __init__(self, trace: Trace, options: BranchOptions, progress: HostProgress | None = None) -> None:
        check_trace(trace)
        self.trace = trace
        self.options = options
        self.played = 0
        self.cpu_s = 0.0
        self.driven_s = 0.0
        self.pictures = 0
        self.camera_s = 0.0
        self.unused_s = 0.0
        self.agreements: dict[tuple[str, str], tuple[int, ...]] = {}
        self._progress: HostProgress = progress or (lambda work, done, due: None)
        ours, theirs = socket.socketpair()
        command = [sys.executable, "-P", "-m", "lingjing.causal.branch_process"]
        try:
            self._process = start_to_last(
                [*command, "--fd", str(theirs.fileno()), "--parent", str(os.getpid())],
                environment((), ENGINE_VARIABLES),
                (theirs.fileno(),),
                2,
            )
        except OSError as error:
            ours.close()
            raise InfrastructureError(f"the branch host cannot be started: {error}") from error
        finally:
            theirs.close()
        self._channel = Channel(ours)
        try:
            self._progress("starting", 0, 0)
            self._send(OpenTrace(options=options))
            self.models = self._expect(TraceOpened).models
            self._refuse_unrecorded_calls()
        except BaseException:
            self.close()
            raise

    def departures(self) -> dict[tuple[str, str], tuple[int, ...]]:
        """Return the departures of all agents: boundaries by (faculty, agent)."""
        self._send(DriveOn())
        reply = self._expect(EpisodeDriven)
        self.driven_s = reply.cpu_s
        self.agreements = {(faculty, agent): ticks for faculty, agent, ticks in reply.agreements}
        return {(faculty, agent): ticks for faculty, agent, ticks in reply.departures}

    def play(
        self, plans: Sequence[BranchPlan], work: str = "branches", ahead: Sequence[BranchPlan] = ()
    ) -> tuple[BranchResult, ...]:
        """Play branches in parallel and return their results in the order of the plans.

        Plans `ahead` may be requested next, the likeliest first; idle workers begin with them. They change when
        results arrive, never the results or the number of played branches. Raises `UsageError` for a plan that the
        trace does not allow, and the error of the first failed branch; a failure among several ends all of them and
        the host.
        """
        for plan in (*plans, *ahead):
            check(plan, self.trace)
        if not plans:
            return ()
        self._send(PlayBranches(plans=tuple(plans), ahead=tuple(ahead)))
        results: dict[int, BranchResult] = {}
        while len(results) < len(plans):
            self._progress(work, len(results), len(plans))
            reply = self._expect(BranchPlayed)
            if reply.result.failed:
                if len(plans) > 1:
                    self.close()
                raise reply.result.error()
            results[reply.index] = reply.result
            self.played += 1
            self.cpu_s += reply.result.cpu_s
            self.pictures += reply.result.pictures
            self.camera_s, self.unused_s = reply.camera_s, reply.unused_s
        self._progress(work, len(plans), len(plans))
        return tuple(results[index] for index in range(len(plans)))

    def close(self) -> None:
        """End the process and all branches."""
        self._channel.close()
        self._process.kill()
        self._process.wait()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _refuse_unrecorded_calls(self) -> None:
        if self.models and self.options.calls != "live":
            agents = ", ".join(f"`{name}`" for name in self.models)
            raise UsageError(
                f"{agents} called chat models, and no answers are recorded after the branch point",
                hint="--calls live calls the models there, at their cost",
            )

    def _send(self, message: HostMessage) -> None:
        try:
            self._channel.send(msgspec.msgpack.encode(message))
        except ChannelClosedError:
            raise self._ended_error() from None

    def _expect(self, kind: type[ReplyT]) -> ReplyT:
        while True:
            try:
                packet = self._channel.receive()
            except ChannelClosedError:
                raise self._ended_error() from None
            reply: HostReply = from_msgpack(packet.payload, HostReply)
            if isinstance(reply, kind):
                return reply
            if isinstance(reply, DrivenTo):
                self._progress("replaying", reply.boundary, len(self.trace.boundaries) - 1)
            elif isinstance(reply, HostFailed):
                raise error_of(reply.exit_code, reply.message, reply.hint)

    def _ended_error(self) -> InfrastructureError:
        """Return the error of a process that has ended."""
        code = self._process.wait()
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        return InfrastructureError(
            f"the process that plays the branches has ended ({how})",
            hint="its output is above; a policy or an engine that runs in it may have ended it",
        )
