"""The links between agents: radio out of range, lost edges, and the visibility of receipts."""

import msgspec
import pytest

from lingjing.kernel.bus import MessageRouter
from lingjing.testing import does, says
from lingjing.testing import rescue as kit
from lingjing.trace.admitted_messages import admitted_at, categories_of

FAR = (("uav[1]", "uav[2]"), ("boat", "uav[1]"))
"""The first scout reaches neither the other scout nor the skipper."""


class Unreachable(kit.Shore):
    """An engine that reports unreachable pairs at every boundary."""

    pairs = FAR

    def reset(self, spec, city, seed):
        return msgspec.structs.replace(super().reset(spec, city, seed), unreachable_links=self.pairs)

    def advance(self, until, mirrors):
        return msgspec.structs.replace(super().advance(until, mirrors), unreachable_links=self.pairs)


class PartlyUnreachable(Unreachable):
    pairs = FAR[:1]


def kernel_of(shore=Unreachable, mode="broadcast", **comms):
    instance = kit.instance(mode)
    instance = msgspec.structs.replace(instance, comms=msgspec.structs.replace(instance.comms, **comms))
    kernel = kit.kernel(instance, kit.RescueEngines(shore=shore))
    return kernel, kernel.reset()


def read(published):
    return {name: [edge.id for edge in inbox.messages] for name, inbox in published.inboxes.items() if inbox.messages}


def bus_receipts(published):
    return [(r.status, r.reason, r.detail) for r in published.record.receipts if r.by == "bus"]


def test_a_recipient_out_of_range_gets_no_message_and_the_receipt_names_it():
    kernel, _ = kernel_of(PartlyUnreachable)
    published = kernel.step(kit.decisions(scout_1=says("order", assignee="boat")))
    assert read(published) == {"skipper": ["m1-1"]}
    assert bus_receipts(published) == [("accepted", "out_of_range", "skipper; out of range: scout[2]")]
    assert published.record.unreachable_links == FAR[:1]


def test_a_message_with_all_recipients_out_of_range_is_rejected():
    kernel, _ = kernel_of()
    published = kernel.step(kit.decisions(scout_1=says("order", assignee="boat")))
    assert read(published) == {}
    assert bus_receipts(published) == [("rejected", "out_of_range", "out of range: scout[2], skipper")]
    assert published.record.messages == ()


def test_a_report_with_all_recipients_out_of_range_is_adjudicated():
    kernel, _ = kernel_of()
    kernel.step(kit.decisions(scout_1=does("takePhoto")))
    published = kernel.step(kit.decisions(scout_1=kit.report("f1-uav[1]-nadir")))
    assert bus_receipts(published)[0][:2] == ("accepted", "out_of_range")
    assert read(published) == {}
    assert [event.kind for event in published.record.events] == ["matched", "reported"]


def test_a_coordinator_without_a_body_is_never_out_of_range():
    kernel, _ = kernel_of(mode="star")
    published = kernel.step(kit.decisions(scout_1=says("order", assignee="boat")))
    assert read(published) == {"commander": ["m1-1"]}


def test_radio_range_is_evaluated_at_the_boundary_of_the_decision():
    """The links of the boundary at which agents decided apply, not those at the end of the tick."""

    class Fading(kit.Shore):
        def advance(self, until, mirrors):
            return msgspec.structs.replace(super().advance(until, mirrors), unreachable_links=FAR)

    kernel, _ = kernel_of(Fading)
    first = kernel.step(kit.decisions(scout_1=says("order", assignee="boat")))
    second = kernel.step(kit.decisions(scout_1=says("order", assignee="boat")))
    assert (sorted(read(first)), read(second)) == (["scout[2]", "skipper"], {})


def expanded(loss, seed=3, count=400):
    instance = kit.instance()
    comms = msgspec.structs.replace(instance.comms, loss=loss)
    router = MessageRouter(msgspec.structs.replace(instance, comms=comms, seed=seed))
    candidates = [("scout[1]", says("order", assignee="boat").messages)]
    return [router.expand(candidates, tick, ()) for tick in range(1, count // 2 + 1)]


@pytest.mark.parametrize("loss", [0.0, 0.1, 0.5])
def test_the_declared_share_of_edges_is_lost(loss):
    arrived = sum(len(edges) for edges, _ in expanded(loss))
    assert arrived == pytest.approx(400 * (1.0 - loss), abs=4 * (400 * loss * (1 - loss)) ** 0.5)


def test_a_lost_edge_is_named_in_the_receipt():
    for edges, (receipt,) in expanded(0.5):
        names = [edge.recipient for edge in edges]
        lost = [name for name in ("scout[2]", "skipper") if name not in names]
        assert receipt.status == ("accepted" if names else "rejected")
        assert receipt.reason == ("lost" if lost else "")
        assert (f"lost on the way to: {', '.join(lost)}" in receipt.detail) == bool(lost)


def test_losses_depend_on_the_seed_and_on_nothing_else():
    assert expanded(0.3) == expanded(0.3)
    assert expanded(0.3) != expanded(0.3, seed=4)
    more = [(scout, says("order", assignee="boat").messages) for scout in ("scout[1]", "scout[2]")]
    instance = kit.instance()
    router = MessageRouter(msgspec.structs.replace(instance, comms=msgspec.structs.replace(instance.comms, loss=0.3)))
    both = [router.expand(more, tick, ()) for tick in range(1, 201)]
    assert [[e for e in edges if e.sender == "scout[1]"] for edges, _ in both] == [list(e) for e, _ in expanded(0.3)]


def test_removing_a_message_does_not_change_other_messages():
    """Ids continue as if the message were there, and losses derive from ids."""
    instance = kit.instance()
    router = MessageRouter(msgspec.structs.replace(instance, comms=msgspec.structs.replace(instance.comms, loss=0.3)))
    first, second = [(scout, says("order", assignee="boat").messages) for scout in ("scout[1]", "scout[2]")]
    whole = [router.expand([first, second], tick, ()) for tick in range(1, 101)]
    without = [router.expand([second], tick, (), removed_ids={f"m{tick}-1"}) for tick in range(1, 101)]
    for (edges, receipts), (left, answers) in zip(whole, without, strict=True):
        assert left == tuple(edge for edge in edges if edge.sender == "scout[2]")
        assert answers == receipts[1:]


def test_a_lost_report_keeps_the_id_that_the_bus_assigned():
    kernel, _ = kernel_of(kit.Shore, loss=1.0)
    kernel.removed_ids = frozenset({"m2-1"})
    kernel.step(kit.decisions(scout_1=does("takePhoto")))
    record = kernel.step(kit.decisions(scout_1=kit.report("f1-uav[1]-nadir"))).record
    assert record.messages == ()
    assert [message.id for message in admitted_at(record, categories_of(kernel.instance))] == ["m2-2"]


@pytest.mark.parametrize(
    ("shown", "scout", "skipper"), [("own", ["c1-1"], []), ("all", ["c1-1"], ["c1-1"]), ("none", [], [])]
)
def test_the_receipts_setting_selects_the_receipts_in_an_inbox(shown, scout, skipper):
    kernel, _ = kernel_of(kit.Shore, receipts=shown)
    published = kernel.step(kit.decisions(scout_1=does("go", x=0.0, y=0.0)))
    seen = {name: sorted({r.request for r in inbox.receipts}) for name, inbox in published.inboxes.items()}
    assert (seen["scout[1]"], seen["skipper"]) == (scout, skipper)
    assert {r.request for r in published.record.receipts} == {"c1-1"}


def test_receipts_of_unlocks_are_in_no_inbox_even_if_all_receipts_are_shared():
    kernel, _ = kernel_of(kit.Shore, receipts="all")
    kernel.step(kit.decisions(scout_1=does("takePhoto")))
    kernel.step(kit.decisions(scout_1=kit.report("f1-uav[1]-nadir")))
    published = kernel.step(kit.decisions())
    assert any(receipt.request.startswith("k") for receipt in published.record.receipts)
    assert not any(r.request.startswith("k") for inbox in published.inboxes.values() for r in inbox.receipts)
