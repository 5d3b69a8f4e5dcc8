"""Validation and conflict resolution of physical commands."""

import msgspec
import pytest

from lingjing.mission.instance import ArgumentSpec, VerbSpec
from lingjing.testing import does
from lingjing.testing import rescue as kit
from lingjing.trace.records import Action, Decision


def kernel_at_zero(*args, **kwargs):
    kernel = kit.kernel(*args, **kwargs)
    kernel.reset()
    return kernel


def refusals(record):
    return [(receipt.sender, receipt.reason) for receipt in record.receipts if receipt.status == "rejected"]


@pytest.mark.parametrize(
    ("made", "reason", "word"),
    [
        (does("go", "submarine", x=0.0, y=0.0), "unknown_resource", "uav[1], boat"),
        (does("go", "victim[1]", x=0.0, y=0.0), "unknown_resource", "uav[1], boat"),
        (does("go", "uav[2]", x=0.0, y=0.0), "no_authority", "only uav[1], boat"),
        (does("fly"), "unknown_verb", "go, hop"),
        (does("go", x=1.0), "bad_argument", "needs `y`"),
        (does("go", x=1.0, y=1.0, w=1.0), "bad_argument", "no argument `w`"),
        (does("go", x=1.0, y="north"), "bad_argument", "finite number"),
        (does("go", x=1.0, y=True), "bad_argument", "finite number"),
        (does("takePhoto", camera="rear"), "bad_argument", "no camera `rear`: nadir"),
        (Decision(command=Action(verb="stop", tick=5)), "stale", "now is 0"),
    ],
)
def test_an_invalid_command_is_rejected_with_a_reason_and_the_valid_choices(made, reason, word):
    record = kernel_at_zero().step(kit.decisions(scout_1=made)).record
    assert refusals(record) == [("scout[1]", reason)]
    assert word in record.receipts[0].detail
    assert record.commands == ()


def test_the_first_valid_request_wins_and_the_conflict_receipt_names_its_sender():
    record = (
        kernel_at_zero()
        .step(
            kit.decisions(
                scout_1=does("nonsense", "boat"),
                scout_2=does("go", "boat", x=5.0, y=5.0),
                skipper=does("go", x=9.0, y=9.0),
            )
        )
        .record
    )
    assert [(command.sender, command.resource) for command in record.commands] == [("scout[2]", "boat")]
    assert refusals(record) == [("scout[1]", "unknown_verb"), ("skipper", "conflict")]
    assert "scout[2]" in next(r for r in record.receipts if r.reason == "conflict").detail


def test_a_busy_resource_refuses_everything_but_stop():
    kernel = kernel_at_zero()
    kernel.step(kit.decisions(skipper=does("go", x=0.0, y=300.0)))
    busy = kernel.step(kit.decisions(skipper=does("go", x=0.0, y=0.0))).record
    assert refusals(busy) == [("skipper", "busy")]
    stopped = kernel.step(kit.decisions(skipper=does("stop"))).record
    assert [(c.verb, c.resource) for c in stopped.commands] == [("stop", "boat")]
    assert refusals(stopped) == []


def test_a_busy_receipt_advises_stop_only_if_the_resource_has_this_verb():
    """Regression: the advice to use `stop` was given for an aeroplane, which has none."""
    instance = kit.instance()
    entities = tuple(
        entity
        if entity.id == "boat"
        else msgspec.structs.replace(entity, verbs=tuple(v for v in entity.verbs if v.name != "stop"))
        for entity in instance.entities
    )
    kernel = kernel_at_zero(msgspec.structs.replace(instance, entities=entities))
    kernel.step(kit.decisions(scout_1=does("hop", distance=40.0), skipper=does("go", x=0.0, y=300.0)))
    record = kernel.step(kit.decisions(scout_1=does("hop", distance=40.0), skipper=does("go", x=0.0, y=0.0))).record
    details = {receipt.sender: receipt.detail for receipt in record.receipts if receipt.reason == "busy"}
    assert details["skipper"].endswith("; `stop` pre-empts it")
    assert details["scout[1]"].startswith("`uav[1]` is still doing") and "stop" not in details["scout[1]"]


def test_a_rejection_by_the_engine_leaves_the_resource_free():
    kernel = kernel_at_zero()
    record = kernel.step(kit.decisions(skipper=does("go", x=450.0, y=0.0))).record
    assert refusals(record) == [("skipper", "unreachable")]
    assert kernel.state.registry.pending == {}


def test_arguments_are_clipped_and_the_receipt_reports_it():
    record = kernel_at_zero().step(kit.decisions(scout_1=does("hop", distance=80.0))).record
    assert record.commands[0].arguments == {"distance": 50.0}
    (receipt,) = record.receipts  # one receipt, from the engine, with the changed value
    assert (receipt.status, receipt.reason, receipt.by) == ("accepted", "clipped", "glider")
    assert "80 → 50" in receipt.detail


def test_a_clipped_command_that_its_engine_rejects_is_rejected_once_and_assigns_nothing():
    kernel = kernel_at_zero(kit.instance(victims=((450.0, 0.0),)))
    record = kernel.step(kit.decisions(scout_1=does("go", x=450.0, y=0.0, z=400.0))).record
    (receipt,) = record.receipts
    assert (receipt.status, receipt.reason) == ("rejected", "unreachable")
    assert "400 → 160" in receipt.detail
    assert kernel.state.registry.assignments == {}
    assert kernel.state.registry.pending == {}


class Preempting(kit.PointMasses):
    """An engine with a `stop` of ten seconds, in which the old request is reported as pre-empted."""

    def reset(self, spec, city, seed):
        self.lost, self.halting = [], {}
        return super().reset(spec, city, seed)

    def admit(self, command):
        if command.verb == "stop" and command.resource in self.jobs:
            self.lost.append(self.receipt(self.jobs[command.resource], "rejected", reason="preempted"))
            self.halting[command.resource] = (command, self.time_s + 10.5)
        return super().admit(command)

    def advance(self, until, mirrors):
        boundary = super().advance(until, mirrors)
        done = [name for name, (_, end) in self.halting.items() if end <= until]
        ended = tuple(self.receipt(self.halting.pop(name)[0], "completed") for name in done)
        early, self.lost = tuple(self.lost), []
        return msgspec.structs.replace(boundary, receipts=early + boundary.receipts + ended)


def test_the_end_of_a_pre_empted_request_does_not_release_its_successor():
    kernel = kernel_at_zero(plugin=kit.RescueEngines(glider=Preempting))
    kernel.step(kit.decisions(skipper=does("go", x=0.0, y=390.0)))
    stopped = kernel.step(kit.decisions(skipper=does("stop"))).record
    assert [(r.request, r.status, r.reason) for r in stopped.receipts] == [
        ("c2-1", "accepted", ""),
        ("c1-1", "rejected", "preempted"),
    ]
    assert kernel.state.registry.pending["boat"].id == "c2-1"
    kernel.step(kit.decisions())
    assert kernel.state.registry.pending == {}


def test_a_stop_without_admission_receipt_leaves_the_old_request_pending():
    class Unresponsive(kit.PointMasses):
        verbs_without_receipt = ("stop",)

    kernel = kernel_at_zero(plugin=kit.RescueEngines(glider=Unresponsive))
    kernel.step(kit.decisions(skipper=does("go", x=0.0, y=390.0)))
    record = kernel.step(kit.decisions(skipper=does("stop"))).record
    assert [(r.request, r.status) for r in record.receipts] == [("c2-1", "timed_out")]
    assert kernel.state.registry.pending["boat"].id == "c1-1"


@pytest.mark.parametrize(
    ("status", "reason"), [("dead", "dead"), ("out_of_view", "not_in_view"), ("below_horizon", "not_in_view")]
)
def test_an_entity_that_is_dead_or_out_of_view_takes_no_pictures(status, reason):
    class Crashed(kit.PointMasses):
        def advance(self, until, mirrors):
            boundary = super().advance(until, mirrors)
            dead = tuple(msgspec.structs.replace(state, status=status) for state in boundary.states)
            return msgspec.structs.replace(boundary, states=dead)

    kernel = kernel_at_zero(plugin=kit.RescueEngines(glider=Crashed))
    kernel.step(kit.decisions())
    record = kernel.step(kit.decisions(scout_1=does("takePhoto"))).record
    assert (refusals(record), record.frames) == ([("scout[1]", reason)], ())


def test_a_picture_that_is_not_drawn_releases_its_resource():
    class Lazy(kit.TruthCamera):
        def capture(self, requests):
            return ()

    kernel = kernel_at_zero(plugin=kit.RescueEngines(table=Lazy))
    published = kernel.step(kit.decisions(scout_1=does("takePhoto")))
    assert [(r.status, r.reason) for r in published.record.receipts] == [("accepted", ""), ("timed_out", "not_drawn")]
    assert [item.reason for item in published.observations["scout[1]"].absent] == ["not_drawn"]
    assert kernel.state.registry.pending == {}


def test_a_command_of_an_agent_without_resources_is_rejected_with_that_reason():
    kernel = kernel_at_zero(kit.instance("star"))
    record = kernel.step(kit.decisions(commander=does("go", x=0.0, y=0.0))).record
    assert refusals(record) == [("commander", "unknown_resource")]
    assert "may command nothing" in record.receipts[0].detail


def test_destinations_are_clipped_to_the_altitude_band():
    record = kernel_at_zero().step(kit.decisions(scout_1=does("go", x=0.0, y=0.0, z=400.0))).record
    assert record.commands[0].arguments["z"] == 160.0


def test_the_altitude_band_clips_the_distance_of_a_climb_and_not_its_rate():
    """A plug-in's verb may have arguments of other dimensions beside a length."""
    arguments = (ArgumentSpec(name="distance", unit="m", maximum=500.0), ArgumentSpec(name="rate", unit="m/s"))
    climb = VerbSpec(name="climb", motion="up", arguments=arguments)
    made = kit.instance()
    entities = [msgspec.structs.replace(entity, verbs=(*entity.verbs, climb)) for entity in made.entities]
    record = (
        kernel_at_zero(msgspec.structs.replace(made, entities=tuple(entities)))
        .step(kit.decisions(scout_1=does("climb", distance=400.0, rate=300.0)))
        .record
    )
    assert record.commands[0].arguments == {"distance": 160.0, "rate": 300.0}


def test_a_photo_needs_an_idle_resource_and_completes_in_its_boundary():
    kernel = kernel_at_zero()
    record = kernel.step(kit.decisions(scout_1=does("takePhoto"), scout_2=does("go", x=300.0, y=0.0))).record
    assert [(r.status, r.detail) for r in record.receipts if r.by == "camera"] == [
        ("accepted", ""),
        ("completed", "f1-uav[1]-nadir"),
    ]
    flying = kernel.step(kit.decisions(scout_2=does("takePhoto"))).record
    assert refusals(flying) == [("scout[2]", "busy")]
    assert flying.frames == ()


@pytest.mark.parametrize(
    ("x", "y", "reason"),
    [
        (12_150.0, -3_120.0, "outside_world"),  # centimetres
        (349_000.0, 3_449_000.0, "outside_world"),  # a UTM grid
        (0.0, -1_500.1, "outside_world"),
        (0.0, -1_500.0, "unreachable"),  # the city ends at 500 m; the engine decides on places up to a kilometre beyond
        (100.0, 100.0, ""),
    ],
)
def test_coordinates_of_another_frame_are_rejected_with_the_valid_frame_and_range(x, y, reason):
    class Narrow(kit.PointMasses):
        def admit(self, command):
            if abs(command.arguments.get("y", 0.0)) > 400:
                return self.receipt(command, "rejected", reason="unreachable")
            return super().admit(command)

    kernel = kit.kernel(plugin=kit.RescueEngines(glider=Narrow))
    kernel.reset()
    published = kernel.step(kit.decisions(scout_1=does("go", x=x, y=y)))
    receipts = [r for r in published.inboxes["scout[1]"].receipts if r.request == "c1-1"]
    assert receipts[0].reason == reason
    if reason == "outside_world":
        assert "metres east and north" in receipts[0].detail and "(-500, -500) and (500, 500)" in receipts[0].detail
        assert kernel.step(kit.decisions(scout_1=does("go", x=100.0, y=100.0))).record.receipts[0].reason == ""
