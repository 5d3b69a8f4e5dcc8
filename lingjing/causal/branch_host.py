"""`BranchHost`: the caller's end of a process that holds an episode and plays branches of it. A context manager."""

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
from lingjing.errors import InfrastructureError, UsageError, error_of
from lingjing.processes.channel import Channel, ChannelClosedError
from lingjing.processes.fork_client import environment, start_to_last
from lingjing.trace.reader import Trace

HostProgress = Callable[[str, int, int], None]
"""Told what goes on, how much of it is done, and how much there is."""

ReplyT = TypeVar("ReplyT", bound=HostMessage)


class BranchHost:
    """Branches of one trace. Raises `UsageError` that says why it cannot be branched here.

    `agreements` are known with the `departures`: the boundaries at which an agent decided something of a faculty and
    decided as its reference did, by (faculty, agent)."""

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
        self._progress: HostProgress = progress or (lambda what, done, due: None)
        ours, theirs = socket.socketpair()
        command = [sys.executable, "-P", "-m", "lingjing.causal.branch_process"]
        try:
            self._process = start_to_last(
                [*command, "--fd", str(theirs.fileno()), "--parent", str(os.getpid())],
                environment(()),
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
            self._refuse_silent_calls()
        except BaseException:
            self.close()
            raise

    def departures(self) -> dict[tuple[str, str], tuple[int, ...]]:
        """Where each agent decided otherwise than its reference: the boundaries by (faculty, agent)."""
        self._send(DriveOn())
        told = self._expect(EpisodeDriven)
        self.driven_s = told.cpu_s
        self.agreements = {(faculty, agent): ticks for faculty, agent, ticks in told.agreements}
        return {(faculty, agent): ticks for faculty, agent, ticks in told.departures}

    def play(
        self, plans: Sequence[BranchPlan], what: str = "branches", ahead: Sequence[BranchPlan] = ()
    ) -> tuple[BranchResult, ...]:
        """Play branches, as many at once as the options say; the results in the order of the plans.

        What may be asked for next is said `ahead`, likeliest first: whoever has nothing else to do begins with it. That
        changes when results come, and neither them nor what counts as played.

        Raises `UsageError` for a plan that the trace has no place for, and the error of the first branch that fails:
        the others of its call are ended, and the host with them.
        """
        for plan in (*plans, *ahead):
            check(plan, self.trace)
        if not plans:
            return ()
        self._send(PlayBranches(plans=tuple(plans), ahead=tuple(ahead)))
        results: dict[int, BranchResult] = {}
        while len(results) < len(plans):
            self._progress(what, len(results), len(plans))
            told = self._expect(BranchPlayed)
            if told.result.failed:
                if len(plans) > 1:
                    self.close()
                raise told.result.error()
            results[told.index] = told.result
            self.played += 1
            self.cpu_s += told.result.cpu_s
            self.pictures += told.result.pictures
            self.camera_s, self.unused_s = told.camera_s, told.unused_s
        self._progress(what, len(plans), len(plans))
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

    def _refuse_silent_calls(self) -> None:
        if self.models and self.options.calls != "live":
            who = ", ".join(f"`{name}`" for name in self.models)
            raise UsageError(
                f"{who} asked chat models: beyond the branch nothing is recorded, and nobody is asked unsaid",
                hint="--calls live asks the models there, for what they cost",
            )

    def _send(self, message: HostMessage) -> None:
        try:
            self._channel.send(msgspec.msgpack.encode(message))
        except ChannelClosedError:
            raise self._gone() from None

    def _expect(self, kind: type[ReplyT]) -> ReplyT:
        while True:
            try:
                packet = self._channel.receive()
            except ChannelClosedError:
                raise self._gone() from None
            told: HostReply = msgspec.msgpack.decode(packet.payload, type=HostReply)
            if isinstance(told, kind):
                return told
            if isinstance(told, DrivenTo):
                self._progress("driving on", told.boundary, len(self.trace.boundaries) - 1)
            elif isinstance(told, HostFailed):
                raise error_of(told.exit_code, told.message, told.hint)

    def _gone(self) -> InfrastructureError:
        """That the process has ended, and how."""
        code = self._process.wait()
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        return InfrastructureError(
            f"the process that plays the branches has ended ({how})",
            hint="what it said is above; policies and engines run in it, and one that ends it does this",
        )
