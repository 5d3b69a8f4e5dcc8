"""Odd values in decisions: each is rejected with a receipt, and none reaches a trace."""

import asyncio

import msgspec
import numpy as np
import pytest

from lingjing.kernel.barrier import PolicyBarrier
from lingjing.kernel.candidates import DECISION_BYTES, THOUGHT_LETTERS, plain_copy
from lingjing.kernel.sequential import SequentialPolicies
from lingjing.testing import does, says, together
from lingjing.testing import rescue as kit
from lingjing.testing.traces import to_json
from lingjing.trace.records import Action, Decision, Outgoing, Usage

NAN, INF = float("nan"), float("inf")


def stepped(made, name="scout_1", **options):
    kernel = kit.kernel(**options)
    kernel.reset()
    kernel.step(kit.decisions(scout_1=does("takePhoto")))
    return kernel.step(kit.decisions(**{name: made})).record


@pytest.mark.parametrize("value", [NAN, INF, -INF, 10**400, -(10**400), 1e308, -1.1e7, 2**63])
@pytest.mark.parametrize("name", ["x", "z"])
def test_an_unusable_number_in_a_command_is_rejected_and_not_treated_as_missing(name, value):
    record = stepped(does("go", **{"x": 0.0, "y": 0.0, name: value}))
    (receipt,) = record.receipts
    assert (receipt.status, receipt.reason) == ("rejected", "bad_argument")
    assert name in receipt.detail
    assert record.commands == ()
    assert b"null" not in msgspec.json.encode(record.decisions[0].decision.command.arguments)


@pytest.mark.parametrize("value", [NAN, INF, 10**400, 1e308])
def test_an_unusable_number_in_a_message_does_not_stop_the_command_of_the_same_decision(value):
    frame = "f1-uav[1]-nadir"
    record = stepped(together(does("go", x=0.0, y=0.0), kit.report(frame, position=(value, 0.0))))
    assert [(r.by, r.status, r.reason) for r in record.receipts] == [
        ("bus", "rejected", "bad_field"),
        ("glider", "accepted", ""),
        ("glider", "completed", ""),
    ]
    assert record.messages == ()
    order = stepped(says("order", assignee="boat", position=(0.0, value)))
    assert [r.reason for r in order.receipts] == ["bad_field"]


@pytest.mark.parametrize(
    "made",
    [
        Decision(usage=Usage(cost_usd=NAN)),
        Decision(usage=Usage(prompt_tokens=10**30)),
        Decision(command=Action(verb="stop", tick=10**30)),
        Decision(thought=object()),
        Decision(messages=(Outgoing(kind="order", body={"assignee": {"deep": 1}}),)),
        Decision(command=Action(verb="go", arguments={"x": [[[]]]})),
        Decision(command=Action(verb="v" * DECISION_BYTES)),
    ],
)
def test_a_decision_that_does_not_fit_the_schema_becomes_a_substituted_no_op(made):
    record = stepped(made)
    assert [(r.status, r.reason) for r in record.receipts] == [("substituted", "malformed")]
    assert record.decisions[0].decision == Decision()
    assert len(to_json(record.decisions[0])) < 1000


def test_a_malformed_decision_keeps_the_usage_of_its_calls():
    """Otherwise a decision that is too large would make calls without a count against the budget."""
    spent = Usage(calls=2, prompt_tokens=700, completion_tokens=50, cost_usd=0.01)
    made = stepped(Decision(command=Action(verb="v" * DECISION_BYTES), usage=spent)).decisions[0]
    assert (made.substituted, made.decision) == ("malformed", Decision(usage=spent))


def test_a_value_that_contains_itself_is_malformed():
    loop = []
    loop.append(loop)
    assert stepped(Decision(command=Action(verb="go", arguments={"x": loop}))).decisions[0].substituted == "malformed"


def test_numpy_values_are_converted_to_plain_values():
    record = stepped(does("go", x=np.float32(1.5), y=np.int64(2), z=np.float64(30.0)))
    assert record.commands[0].arguments == {"x": 1.5, "y": 2.0, "z": 30.0}
    where = stepped(says("order", assignee="boat", position=np.array([1.0, 2.0])))
    assert where.messages[0].body["position"] == (1.0, 2.0)


def test_a_lone_surrogate_is_replaced_and_a_long_thought_is_cut():
    made = stepped(Decision(thought="\ud83dno" + "x" * 10**6)).decisions[0]
    assert made.substituted == ""
    assert made.decision.thought.startswith("\ufffdno")
    assert len(made.decision.thought) == THOUGHT_LETTERS
    assert plain_copy(Decision(thought="grün 🛟")).thought == "grün 🛟"


def test_plain_copy_is_idempotent():
    made = together(does("go", x=NAN, y=10**30), kit.report("f", position=(INF, -INF)))
    assert plain_copy(plain_copy(made)) == plain_copy(made)


def test_a_subclass_of_decision_is_accepted_unless_it_adds_fields():
    class Same(Decision, frozen=True):
        pass

    class More(Decision, frozen=True):
        mood: str = "good"

    assert type(stepped(Same(thought="hm")).decisions[0].decision) is Decision
    assert stepped(More()).decisions[0].substituted == "malformed"


def test_a_policy_cannot_change_a_decision_after_returning_it():
    body = {"assignee": "boat"}
    kernel = kit.kernel()
    kernel.reset()
    record = kernel.step(kit.decisions(scout_1=Decision(messages=(Outgoing(kind="order", body=body),)))).record
    body["assignee"] = "uav[1]"
    assert {edge.body["assignee"] for edge in record.messages} == {"boat"}
    assert record.decisions[0].decision.messages[0].body == {"assignee": "boat"}


class Raising:
    def __init__(self, error):
        self.error = error

    async def reset(self, brief):
        pass

    async def act(self, observation, inbox):
        raise self.error


class WordlessError(Exception):
    def __str__(self):
        raise OSError("no words")


@pytest.mark.parametrize("kind", [PolicyBarrier, SequentialPolicies])
@pytest.mark.parametrize(
    ("error", "words"),
    [
        (GeneratorExit(), "GeneratorExit"),
        (asyncio.CancelledError(), "CancelledError"),
        (BaseException("odd"), "BaseException"),
        (WordlessError(), "WordlessError"),
        (ValueError(), "ValueError"),
    ],
)
def test_any_exception_of_a_policy_is_a_policy_error(error, words, kind):
    barrier = kind({"a": Raising(error)}, 5.0)
    (made,) = barrier.act({"a": (None, None)})
    barrier.close()
    assert (made.substituted, words in made.detail) == ("policy_error", True)


def test_the_address_of_an_object_is_removed_from_error_details():
    details = set()
    for _ in range(2):
        barrier = PolicyBarrier({"a": Raising(ValueError(object()))}, 5.0)
        details.add(barrier.act({"a": (None, None)})[0].detail)
        barrier.close()
    line = Raising.act.__code__.co_firstlineno + 1
    assert details == {f"ValueError: <object object at 0x…> (tests/kernel/test_candidates.py:{line})"}


def test_the_wall_time_of_a_call_excludes_that_of_the_previous_call():
    class Sleeping(Raising):
        async def act(self, observation, inbox):
            await asyncio.sleep(self.error)
            return Decision()

    barrier = PolicyBarrier({"slow": Sleeping(0.4), "quick": Sleeping(0.0)}, 5.0)
    slow, quick = barrier.act(dict.fromkeys(("slow", "quick"), (None, None)))
    barrier.close()
    assert slow.policy_wall_s >= 0.4
    assert quick.policy_wall_s < slow.policy_wall_s
