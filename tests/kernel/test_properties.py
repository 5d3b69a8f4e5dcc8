"""Invariants of the kernel under random decisions over thirty ticks."""

import random

import msgspec
from hypothesis import given, settings
from hypothesis import strategies as st

from lingjing.testing import CENTRE_BOX
from lingjing.testing import rescue as kit
from lingjing.testing.traces import from_json, to_json
from lingjing.trace.records import Action, BoundaryRecord, Decision, DecisionRecord, Outgoing

TICKS = 30
ODD = (float("nan"), float("inf"), 1e300, 10**30, -0.0, 390.0, 450.0)
NAMES = ("scout[1]", "scout[2]", "skipper", "commander", "uav[1]", "boat", "ghost", "")
RESOURCES = (None, None, None, "uav[1]", "uav[2]", "boat", "victim[1]", "ghost")
BOXES = (CENTRE_BOX, CENTRE_BOX, (0.0, 0.0, 0.1, 0.1), (0.42, 0.4, 0.6, 0.6), (0.6, 0.4, 0.4, 0.6))


class Whim:
    """A policy of random decisions from one seed: mostly sensible, sometimes absurd."""

    def __init__(self, seed):
        self.random = random.Random(seed)

    def decision(self, tick):
        messages = tuple(self.message(tick) for _ in range(self.random.randrange(3)))
        return Decision(command=self.action(tick), messages=messages, thought=self.random.choice(("", "\ud83d")))

    def action(self, tick):
        pick, verb = (
            self.random.choice,
            self.random.choice(("", "takePhoto", "takePhoto", "go", "go", "stop", "hop", "fly")),
        )
        if verb == "go" and self.random.random() < 0.5:
            return Action(verb="go", arguments={"x": pick((100.0, -100.0)), "y": 0.0})
        if verb == "go":
            return Action(
                verb="go",
                arguments={"x": self.number(), "y": self.number()},
                resource=pick(RESOURCES),
                tick=pick((None, None, tick, tick - 1)),
            )
        if verb == "hop":
            return Action(verb="hop", arguments={pick(("distance", "camera")): self.number()}, resource=pick(RESOURCES))
        return Action(verb=verb, resource=pick(RESOURCES)) if verb else None

    def message(self, tick):
        pick = self.random.choice
        place = pick(((100.0, 0.0), (self.number(), self.number()), (1.0,), self.number()))
        if self.random.random() < 0.3:
            body = {"assignee": pick(NAMES), "position": place}
            return Outgoing(kind=pick(("order", "order", "detection", "shout")), body=body, to=(pick(NAMES),))
        frame = f"f{tick - self.random.randrange(2)}-uav[{pick((1, 1, 2, 3))}]-nadir"
        body = {"frame": frame, "class": pick(("person", "person", "buoy")), "box": pick(BOXES), "position": place}
        return Outgoing(kind="detection", body={**body, "confidence": pick((0.5, 0.5, self.number()))})

    def number(self):
        pick = self.random.choice
        return pick((pick(ODD), self.random.uniform(-400.0, 400.0), pick((0.0, 50.0, 100.0, -100.0))))


class Stopping(kit.PointMasses):
    """An engine that ends the requests that `stop` pre-empts and completes `stop` itself, as the built-in engines
    do.
    """

    def reset(self, spec, city, seed):
        self.outbox = []
        return super().reset(spec, city, seed)

    def admit(self, command):
        held = self.jobs.get(command.resource)
        receipt = super().admit(command)
        if command.verb == "stop" and held is not None:
            self.outbox.append(self.receipt(held, "rejected", reason="preempted"))
        if command.verb in ("stop", "hop"):
            self.outbox.append(self.receipt(command, "completed"))
        return receipt

    def advance(self, until, mirrors):
        boundary, self.outbox = super().advance(until, mirrors), self.outbox
        receipts, self.outbox = tuple(self.outbox) + boundary.receipts, []
        return msgspec.structs.replace(boundary, receipts=receipts)


def make_kernel(mode):
    instance = kit.instance(mode, ticks=TICKS)
    instance = msgspec.structs.replace(instance, clock=msgspec.structs.replace(instance.clock, sync_s=5.0))
    return kit.kernel(instance, kit.RescueEngines(glider=Stopping))


def played(mode, whim):
    """Return the kernel after thirty ticks and its boundary outputs."""
    kernel = make_kernel(mode)
    instance, published = kernel.instance, [kernel.reset()]
    for tick in range(TICKS):
        made = [DecisionRecord(agent=agent.id, decision=whim.decision(tick)) for agent in instance.agents]
        published.append(kernel.step(made))
    return kernel, published


def replayed(mode, records):
    """Return the digests of the episode repeated from its recorded decisions."""
    kernel = make_kernel(mode)
    again = [kernel.reset().record]
    again += [kernel.step(from_json(to_json(record), BoundaryRecord).decisions).record for record in records[1:]]
    return [record.digest for record in again]


def check_boundary(published, instance):
    record, agents = published.record, {agent.id: agent for agent in instance.agents}
    commands = [command for command in record.commands if command.origin == "agent"]
    assert len({command.resource for command in commands}) == len(commands)
    assert all(command.resource in agents[command.sender].commands for command in commands)
    answered = [receipt.request for receipt in record.receipts]
    candidates = sum(made.decision.command is not None for made in record.decisions)
    letters = sum(len(made.decision.messages) for made in record.decisions)
    assert {f"c{record.tick}-{n}" for n in range(1, candidates + 1)} <= set(answered)
    assert [f"m{record.tick}-{n}" for n in range(1, letters + 1)] == [n for n in answered if n.startswith("m")]
    admissions = [r.request for r in record.receipts if r.status == "accepted"]
    assert len(admissions) == len(set(admissions))
    for agent, inbox in published.inboxes.items():
        assert list(inbox.messages) == [edge for edge in record.messages if edge.recipient == agent]
        assert all(edge.sender != agent for edge in inbox.messages)
        assert list(inbox.receipts) == [receipt for receipt in record.receipts if receipt.sender == agent]
    assert "victim" not in repr((published.observations, [inbox.messages for inbox in published.inboxes.values()]))
    receipts = [receipt for inbox in published.inboxes.values() for receipt in inbox.receipts]
    assert {r.reason for r in receipts if "victim" in repr(r)} <= {
        "unknown_resource",
        "stale",
    }  # as if it did not exist
    assert from_json(to_json(record), BoundaryRecord) == record


def check_requests(records, kernel):
    ended, opened = {}, {}
    for receipt in (receipt for record in records for receipt in record.receipts):
        if receipt.status in ("completed", "rejected", "timed_out"):
            assert receipt.request not in ended
            ended[receipt.request] = receipt
        elif receipt.status == "accepted" and receipt.request[0] == "c":
            opened[receipt.request] = receipt
    held = {command.id for command in kernel.state.registry.pending.values()}
    assert held == opened.keys() - ended.keys()


def check_events(records):
    latched = [(event.kind, event.bindings) for record in records for event in record.events]
    assert len(latched) == len(set(latched))
    stages = [(change.stage, change.subject) for record in records for change in record.stages]
    assert len(stages) == len(set(stages))
    claims = [(e.bindings[0], e.bindings[1]) for record in records for e in record.events if e.kind == "matched"]
    assert len({report for _, report in claims}) == len(claims)
    ids = [event.id for record in records for event in record.events]
    assert len(ids) == len(set(ids))


@settings(max_examples=15, deadline=None)
@given(mode=st.sampled_from(["star", "broadcast"]), seed=st.integers(0, 2**32))
def test_invariants_hold_for_random_decisions(mode, seed):
    kernel, published = played(mode, Whim(seed))
    records = [output.record for output in published]
    for output in published:
        check_boundary(output, kernel.instance)
    check_requests(records, kernel)
    check_events(records)
    assert replayed(mode, records) == [record.digest for record in records]


def test_the_random_decisions_cover_the_cases_of_the_invariants():
    kernel, published = played("broadcast", Whim(1))
    receipts = [(receipt.status, receipt.reason) for output in published for receipt in output.record.receipts]
    reasons = {"busy", "conflict", "stale", "no_authority", "bad_argument", "bad_field", "preempted"}
    assert reasons <= {reason for _, reason in receipts}
    assert {"matched", "reported"} <= {event.kind for output in published for event in output.record.events}
    assert kernel.state.evaluation.reward < 1.0
