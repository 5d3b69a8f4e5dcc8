"""An agent's own commands and claims, counted as the kernel counts them."""

import msgspec
from lingjing_agents.react.own_counts import OwnCounts

from agents.tests.agent_kit import brief
from lingjing.plugins.policy import Decision, Inbox, MessageSpec, Outgoing, Receipt

JAMMED = MessageSpec(kind="jammed", type="trafficJam", category="target_status", fields=(), senders=("all",),
                     recipients=("all",))  # fmt: skip


def _report(box: tuple[float, ...], cls: str = "person_in_water") -> Outgoing:
    return Outgoing(kind="sighting", body={"frame": "f1", "class": cls, "box": box, "confidence": 0.5})


def test_a_claim_that_is_repeated_counts_once_and_another_box_class_or_route_counts_again() -> None:
    counts = OwnCounts(msgspec.structs.replace(brief(), messages=(JAMMED,)))
    assert counts.members() == {"your_counts": {}}
    for _ in range(2):
        counts.send(Decision(messages=(_report((0.1, 0.1, 0.2, 0.2)), Outgoing(kind="note", body={"text": "frame"}))))
    assert counts.members() == {"your_counts": {"claims": 1}}
    around = Outgoing(kind="jammed", body={"waypoint": 2, "position": (1.0, 2.0)})
    status = Outgoing(kind="progress", body={"task": "search", "state": "done", "position": (5.0, 2.0)})
    counts.send(
        Decision(messages=(_report((0.1, 0.1, 0.2, 0.3)), _report((0.1, 0.1, 0.2, 0.2), "buoy"), around, status))
    )
    assert counts.members() == {"your_counts": {"claims": 4}}


def test_accepted_commands_are_counted_by_resource_and_those_of_others_are_not() -> None:
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
    assert counts.members() == {"your_counts": {"commands_accepted": {"boat": 1, "uav[1]": 2}}}
