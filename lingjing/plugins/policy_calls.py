"""The model calls of one policy object: the tick of a call, and the bill of a decision.

`PolicyCalls` is around the record that a policy receives. It knows the present tick, so that a policy need not tell it,
and sums the usage of the calls. `BilledPolicy` writes that sum into each decision without a usage of its own.
"""

from __future__ import annotations

import threading

import msgspec

from lingjing.plugins.calls import AbandonedCallError, CallRequest, CallResult, ModelBroker, ModelCalls, ModelQuestion
from lingjing.plugins.policy import (
    Brief,
    Decision,
    Inbox,
    InfrastructureError,
    NoDecisionError,
    Observation,
    Policy,
    Usage,
)


class PolicyCalls:
    """`ModelCalls` of one policy object. Any thread may call it."""

    def __init__(self, calls: ModelCalls) -> None:
        self._calls = calls
        self._lock = threading.Lock()
        self._usage = Usage()
        self.tick = 0
        """The boundary of the present decision."""
        self.interruption: AbandonedCallError | InfrastructureError | None = None
        """The error of the record or the limits at this boundary. A framework may have caught it."""

    @property
    def replaying(self) -> bool:
        """See `ModelCalls.replaying`."""
        return self._calls.replaying

    @property
    def capped(self) -> bool:
        """See `ModelCalls.capped`."""
        return self._calls.capped

    @property
    def broker(self) -> ModelBroker | None:
        """See `ModelCalls.broker`."""
        return None if self._calls.broker is None else _CountedBroker(self._calls.broker, self)

    def begin(self, request: CallRequest) -> CallResult | None:
        """See `ModelCalls.begin`."""
        try:
            result = self._calls.begin(request)
        except AbandonedCallError as error:
            self.interruption = error
            self._add(error.result)
            raise
        except InfrastructureError as error:
            self.interruption = error
            raise
        if result is not None:
            self._add(result)
        return result

    def end(self, request: CallRequest, result: CallResult) -> None:
        """See `ModelCalls.end`."""
        try:
            self._calls.end(request, result)
        except InfrastructureError as error:
            self.interruption = error
            raise
        finally:
            self._add(result)

    def bill(self) -> Usage:
        """Return the usage since the last bill."""
        with self._lock:
            usage, self._usage = self._usage, Usage()
        return usage

    def add(self, result: CallResult) -> None:
        """Add the usage of a call to the next bill."""
        self._add(result)

    def _add(self, result: CallResult) -> None:
        with self._lock:
            self._usage = with_result(self._usage, result)


def with_result(spent: Usage, result: CallResult) -> Usage:
    """Return the usage with that of a further call."""
    return Usage(
        calls=spent.calls + result.attempts,
        prompt_tokens=spent.prompt_tokens + result.prompt_tokens,
        completion_tokens=spent.completion_tokens + result.completion_tokens,
        cost_usd=spent.cost_usd + (result.cost_usd or 0.0),
    )


class _CountedBroker:
    """A broker with answers that are billed to a policy object."""

    def __init__(self, broker: ModelBroker, calls: PolicyCalls) -> None:
        self._broker = broker
        self._calls = calls

    async def ask(self, question: ModelQuestion) -> CallResult:
        """See `ModelBroker.ask`."""
        try:
            result = await self._broker.ask(question)
        except AbandonedCallError as error:
            self._calls.interruption = error
            self._calls.add(error.result)
            raise
        except InfrastructureError as error:
            self._calls.interruption = error
            raise
        self._calls.add(result)
        return result


class BilledPolicy:
    """A policy with the usage of its calls in its decisions."""

    def __init__(self, policy: Policy, calls: PolicyCalls) -> None:
        self._policy = policy
        self._calls = calls

    async def reset(self, brief: Brief) -> None:
        """Begin an episode."""
        self._calls.tick = 0
        self._calls.bill()
        await self._policy.reset(brief)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the decision of the policy with its usage."""
        self._calls.tick, self._calls.interruption = observation.tick, None
        try:
            decision: object = await self._policy.act(observation, inbox)  # foreign code may return anything
        except NoDecisionError as error:
            error.usage = self._usage(error.usage)
            raise
        except Exception as error:
            if self._calls.interruption is not None:
                raise self._calls.interruption from error
            raise
        usage = self._usage(decision.usage if isinstance(decision, Decision) else None)
        if not isinstance(decision, Decision):
            return decision  # type: ignore[return-value]  # the kernel reports its type
        return msgspec.structs.replace(decision, usage=usage)

    def _usage(self, own: Usage | None) -> Usage | None:
        """Return the usage of a decision: that of the policy, else that of its calls, if there are some.

        Raises the error of the record or the limits, whatever the policy made of it.
        """
        if self._calls.interruption is not None:
            raise self._calls.interruption
        usage = self._calls.bill()
        return usage if own is None and usage.calls else own


def tick_of(calls: ModelCalls) -> int:
    """Return the tick of the present decision; 0 outside of an episode."""
    return calls.tick if isinstance(calls, PolicyCalls) else 0


__all__ = ["BilledPolicy", "PolicyCalls", "tick_of"]
