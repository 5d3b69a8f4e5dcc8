"""Message routing and timing under star and broadcast, to the tick."""

import msgspec
import pytest

from lingjing.kernel.bus import MessageRouter
from lingjing.plugins.decisions import MESSAGES_PER_CALL
from lingjing.testing import does, says
from lingjing.testing import rescue as kit


def read(published):
    return {name: [edge.id for edge in inbox.messages] for name, inbox in published.inboxes.items() if inbox.messages}


def test_broadcast_is_read_by_all_other_agents_at_the_next_boundary():
    kernel = kit.kernel()
    kernel.reset()
    assert read(kernel.step(kit.decisions(scout_1=says("order", assignee="boat")))) == {
        "scout[2]": ["m1-1"],
        "skipper": ["m1-1"],
    }
    assert read(kernel.step(kit.decisions())) == {}


def test_star_reaches_the_hub_first_and_the_recipient_one_boundary_later():
    kernel = kit.kernel(kit.instance("star"))
    kernel.reset()
    up = kernel.step(kit.decisions(scout_1=says("order", assignee="boat")))  # produced on 0
    down = kernel.step(kit.decisions(commander=says("order", to=("skipper",), assignee="boat")))  # answers 1
    assert (up.record.tick, read(up)) == (1, {"commander": ["m1-1"]})
    assert (down.record.tick, read(down)) == (2, {"skipper": ["m2-1"]})


def test_the_hub_of_a_star_does_not_relay_messages_automatically():
    kernel = kit.kernel(kit.instance("star"))
    kernel.reset()
    kernel.step(kit.decisions(scout_1=says("order", to=("skipper",), assignee="boat")))
    assert [read(kernel.step(kit.decisions())) for _ in range(3)] == [{}, {}, {}]


def test_a_hub_message_without_recipients_goes_to_all_that_its_kind_declares():
    kernel = kit.kernel(kit.instance("star"))
    kernel.reset()
    assert sorted(read(kernel.step(kit.decisions(commander=says("order", assignee="boat"))))) == [
        "scout[1]",
        "scout[2]",
        "skipper",
    ]


def test_a_longer_delay_holds_a_message_back_by_whole_ticks():
    instance = kit.instance()
    kernel = kit.kernel(msgspec.structs.replace(instance, comms=msgspec.structs.replace(instance.comms, delay_ticks=3)))
    kernel.reset()
    outs = [kernel.step(kit.decisions(scout_1=says("order", assignee="boat")))]
    outs += [kernel.step(kit.decisions()) for _ in range(3)]
    assert [bool(read(out)) for out in outs] == [False, False, True, False]


GOOD = {
    "frame": "f0",
    "class": "person",
    "box": (0.1, 0.1, 0.2, 0.2),
    "position": (1.0, 2.0),
    "confidence": 0.5,
}


@pytest.mark.parametrize(
    ("kind", "change", "reason", "word"),
    [
        ("detection", {}, "", ""),
        ("shout", {}, "unknown_kind", "detection, order"),
        ("detection", {"frame": "f9"}, "bad_field", "names no picture"),
        ("detection", {"box": (0.5, 0.1, 0.2, 0.2)}, "bad_field", "min < max"),
        ("detection", {"box": (-0.1, 0.1, 0.2, 0.2)}, "bad_field", "min < max"),
        ("detection", {"box": (0.1, 0.1, 0.2)}, "bad_field", "four numbers"),
        ("detection", {"position": (1.0, float("inf"))}, "bad_field", "finite"),
        ("detection", {"position": (1.0,)}, "bad_field", "two or three"),
        ("detection", {"confidence": 1.5}, "bad_field", "0.0..1.0"),
        ("detection", {"confidence": True}, "bad_field", "finite number"),
        ("detection", {"class": 3}, "bad_field", "text"),
        ("detection", {"class": None}, "bad_field", "missing"),
        ("detection", {"speed": 3}, "bad_field", "not a field"),
        ("detection", {"class": "x" * 5000}, "payload", "at most 4000"),
    ],
)
def test_an_invalid_message_is_rejected_with_its_reason(kind, change, reason, word):
    body = {key: value for key, value in {**GOOD, **change}.items() if value is not None}
    edges, (receipt,) = MessageRouter(kit.instance()).expand(
        [("scout[1]", says(kind, **body).messages)], 1, frames=["f0"]
    )
    assert (receipt.reason, receipt.status) == (reason, "rejected" if reason else "accepted")
    assert word in receipt.detail
    assert bool(edges) is not bool(reason)


def test_messages_beyond_the_limit_per_call_are_rejected():
    many = says("order", assignee="boat").messages * (MESSAGES_PER_CALL + 2)
    edges, receipts = MessageRouter(kit.instance()).expand([("scout[1]", many)], 1, frames=())
    assert len(edges) == 2 * MESSAGES_PER_CALL
    assert [r.reason for r in receipts[-2:]] == ["too_many", "too_many"]


def test_an_unknown_sender_and_an_unknown_recipient_are_refused():
    router = MessageRouter(kit.instance("star"))
    _, (ghost,) = router.expand([("ghost", says("order", assignee="boat").messages)], 1, frames=())
    _, (lost,) = router.expand([("commander", says("order", to=("ghost",), assignee="b").messages)], 1, frames=())
    assert (ghost.reason, lost.reason) == ("unknown_agent", "bad_recipient")


def test_the_size_of_a_message_is_that_of_its_body_as_json():
    edges, _ = MessageRouter(kit.instance()).expand([("scout[1]", says("order", assignee="boat").messages)], 1, ())
    assert {edge.bytes for edge in edges} == {len(b'{"assignee":"boat"}')}


def with_delay(ticks, delay, **changes):
    instance = kit.instance(ticks=ticks, **changes)
    return msgspec.structs.replace(instance, comms=msgspec.structs.replace(instance.comms, delay_ticks=delay))


def test_a_message_due_after_the_last_boundary_is_rejected_as_expired():
    kernel = kit.kernel(with_delay(ticks=3, delay=2))
    kernel.reset()
    order = kit.decisions(scout_1=says("order", assignee="boat"))
    reasons = [[r.reason for r in kernel.step(order).record.receipts] for _ in range(3)]
    assert reasons == [[""], [""], ["expired"]]


def test_messages_of_the_last_tick_are_read_at_the_last_boundary():
    kernel = kit.kernel(kit.instance(ticks=1))
    kernel.reset()
    assert sorted(read(kernel.step(kit.decisions(scout_1=says("order", assignee="boat"))))) == [
        "scout[2]",
        "skipper",
    ]


def test_a_report_is_adjudicated_when_sent_even_with_delayed_or_no_recipients():
    alone = kit.instance()
    alone = msgspec.structs.replace(alone, agents=alone.agents[:1])
    for instance in (alone, with_delay(ticks=2, delay=5)):
        kernel = kit.kernel(instance)
        kernel.reset()
        kernel.step(kit.decisions(scout_1=does("takePhoto")))
        record = kernel.step(kit.decisions(scout_1=kit.report("f1-uav[1]-nadir"))).record
        assert [event.kind for event in record.events] == ["matched", "reported"]
        assert [(r.status, r.detail[:11]) for r in record.receipts] == [("accepted", "adjudicated")]
        assert record.messages == ()


def test_a_message_to_its_sender_or_to_an_inactive_hub_is_rejected():
    star = kit.instance("star")
    router = MessageRouter(star)
    _, (self_addressed,) = router.expand([("commander", says("order", ("commander",), assignee="b").messages)], 1, ())
    headless = MessageRouter(msgspec.structs.replace(star, agents=star.agents[:3]))
    _, (lost,) = headless.expand([("scout[1]", says("order", assignee="b").messages)], 1, ())
    assert (self_addressed.reason, lost.reason) == ("bad_recipient", "no_recipient")
