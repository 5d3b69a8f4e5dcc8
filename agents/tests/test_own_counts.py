"""An agent's own commands, messages, claims and orders, counted as the kernel counts them."""

import msgspec
from lingjing_agents.react.own_counts import MOST_ORDERS, OwnCounts, OwnOrders

from agents.tests.agent_kit import GUIDANCE, brief, observe, sent_by, view
from lingjing.mission.instance import CountedSpec, LimitSpec
from lingjing.plugins.policy import Action, Decision, Inbox, MessageSpec, Outgoing, Peer, Receipt

JAMMED = MessageSpec(kind="jammed", type="trafficJam", category="target_status", fields=(), senders=("all",),
                     recipients=("all",))  # fmt: skip


def _report(box: tuple[float, ...], cls: str = "person_in_water") -> Outgoing:
    return Outgoing(kind="sighting", body={"frame": "f1", "class": cls, "box": box, "confidence": 0.5})


def test_a_claim_that_is_repeated_counts_once_and_another_box_class_or_route_counts_again() -> None:
    counts = OwnCounts(msgspec.structs.replace(brief(), messages=(JAMMED,)))
    assert counts.members()["your_counts"] == {}
    for _ in range(2):
        counts.send(
            Decision(messages=(_report((0.1, 0.1, 0.2, 0.2)), Outgoing(kind="note", body={"text": "frame"}))), 0
        )
    assert counts.members()["your_counts"] == {"claims": 1}
    around = Outgoing(kind="jammed", body={"waypoint": 2, "position": (1.0, 2.0)})
    status = Outgoing(kind="progress", body={"task": "search", "state": "done", "position": (5.0, 2.0)})
    counts.send(
        Decision(messages=(_report((0.1, 0.1, 0.2, 0.3)), _report((0.1, 0.1, 0.2, 0.2), "buoy"), around, status)), 1
    )
    assert counts.members()["your_counts"] == {"claims": 4}


def test_accepted_commands_are_counted_by_resource_without_those_of_other_agents() -> None:
    counts = OwnCounts(brief())

    def receipt(request: str, sender: str, status: str, resource: str = "uav[1]") -> Receipt:
        return Receipt(request=request, tick=1, sender=sender, resource=resource, status=status)  # type: ignore[arg-type]

    counts.receive(
        Inbox(
            receipts=(
                receipt("c1-1", "scout[1]", "accepted"), receipt("c1-1", "scout[1]", "completed"),
                receipt("c2-1", "scout[1]", "rejected"), receipt("c3-1", "skipper", "accepted", "boat"),
                receipt("c4-1", "scout[1]", "accepted", "boat"), receipt("c5-1", "scout[1]", "accepted"),
            )
        )
    )  # fmt: skip
    assert counts.members()["your_counts"] == {"commands_accepted": {"boat": 1, "uav[1]": 2}}


def _accepted(request: str, tick: int, resource: str, status: str = "accepted") -> Receipt:
    return Receipt(request=request, tick=tick, sender="scout[1]", resource=resource, status=status, by="bus")  # type: ignore[arg-type]


def test_the_remainder_of_each_limit_subtracts_only_the_agents_own_use() -> None:
    limits = (
        LimitSpec(name="guidance", most=2, counts=(CountedSpec(kind="message", name="guide"),)),
        LimitSpec(name="moves", most=9, counts=(CountedSpec(kind="command", resource="uav[1]"),)),
        LimitSpec(name="photos", most=5, counts=(CountedSpec(kind="command", resource="uav[1]", name="takePhoto"),)),
        LimitSpec(name="positives", most=6, counts=(CountedSpec(kind="claims"),)),
        LimitSpec(name="in_a_stage", most=6, counts=(CountedSpec(kind="claims"),), stage="find"),
    )
    counts = OwnCounts(msgspec.structs.replace(brief(), limits=limits))
    for tick, verb in enumerate(("up", "takePhoto")):
        counts.send(
            Decision(command=Action(verb=verb, resource="uav[1]"), messages=(_report((0.1, 0.1, 0.2, 0.2)),)), tick
        )
        counts.receive(Inbox(receipts=(_accepted(f"c{tick + 1}-1", tick + 1, "uav[1]"),)))
    for tick in (3, 4, 5):
        counts.receive(Inbox(receipts=(_accepted(f"m{tick}-1", tick, "guide"),)))
    counts.receive(Inbox(receipts=(_accepted("m6-1", 6, "guide", "rejected"),)))
    assert counts.members() == {
        "your_counts": {"commands_accepted": {"uav[1]": 2}, "messages_accepted": {"guide": 3}, "claims": 1},
        "limits_left_at_most": {"guidance": 0, "moves": 7, "photos": 4, "positives": 5},
    }


GUIDE = sent_by(GUIDANCE, "searcher")
WALKER = Peer(id="walker", role="executor", resources=("dog",))


def _guide(amount: float, east: float, assignee: str = "walker") -> Outgoing:
    return Outgoing(
        kind="guide", body={"assignee": assignee, "step": "forward", "amount": amount, "position": (east, 0.0)}
    )


def _orders() -> OwnOrders:
    return OwnOrders(msgspec.structs.replace(brief(), messages=(GUIDE,), peers=(WALKER,)))


def test_the_last_order_is_repeated_with_the_distance_left_to_its_position() -> None:
    orders = _orders()
    assert orders.members(observe("scout[1]", 0))["your_last_orders"] == []
    orders.send(Decision(messages=(_guide(7.5, 30.0),)), 4)
    orders.send(Decision(messages=(_report((0.1, 0.1, 0.2, 0.2)),)), 5)
    seen = observe("scout[1]", 6, view("dog", (10.0, 0.0, 0.3)), view("uav[1]", (0.0, 0.0, 40.0)))
    assert orders.members(seen)["your_last_orders"] == [
        {"kind": "guide", "assignee": "walker", "step": "forward", "amount": 7.5, "position": (30.0, 0.0),
         "sent_at_tick": 4, "distance_left_m": 20.0, "bearing_deg": 90.0}
    ]  # fmt: skip
    (blind,) = orders.members(observe("scout[1]", 6))["your_last_orders"]  # type: ignore[misc]
    assert "distance_left_m" not in blind, "a place that the agent does not observe is not told"


def test_a_rejected_order_is_taken_back() -> None:
    orders = _orders()
    orders.send(Decision(messages=(_guide(7.5, 30.0),)), 4)
    orders.receive(Inbox(receipts=(_accepted("m5-1", 5, "guide"),)))
    orders.send(Decision(messages=(_guide(2.0, 40.0),)), 6)
    orders.receive(Inbox(receipts=(_accepted("m7-1", 7, "guide", "rejected"),)))
    (order,) = orders.members(observe("scout[1]", 7))["your_last_orders"]  # type: ignore[misc]
    assert (order["sent_at_tick"], order["amount"]) == (4, 7.5)


def test_only_the_newest_orders_of_a_large_fleet_are_listed() -> None:
    orders = _orders()
    for tick in range(30):
        orders.send(Decision(messages=(_guide(1.0, 2.0, f"dog[{tick}]"),)), tick)
    newest = orders.members(observe("scout[1]", 30))["your_last_orders"]
    assert [order["sent_at_tick"] for order in newest] == list(range(30 - MOST_ORDERS, 30))  # type: ignore[attr-defined]
