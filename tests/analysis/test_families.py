"""The rules of the failure families on synthetic traces, and their agreement with the labels of a reader."""

import tomllib
from collections import Counter
from pathlib import Path

import msgspec
import pytest

from lingjing import Session, Trace
from lingjing import read as read_trace
from lingjing.analysis import families
from lingjing.analysis.ending import why
from lingjing.analysis.families import FAMILIES, Attribution, attribute
from lingjing.bench.played import Played
from lingjing.mission.instance import MessageSpec
from lingjing.play.report import report_of
from lingjing.testing import bare_instance, shipped_missions
from lingjing.testing.declarations import Field, Relation, Rule, RuleParameter, Stage
from lingjing.testing.expressions import Attr, Binary, Call, Flag, Quantified, Ref, Symbol
from lingjing.trace.records import (
    Action,
    AdjudicatedEvent,
    BoundaryRecord,
    Box,
    Command,
    Decision,
    DecisionRecord,
    Envelope,
    Outcome,
    Receipt,
    StageChange,
)
from tests.analysis.test_metrics import at, boundary, frame, matched, report

replace = msgspec.structs.replace
LABELS = Path(__file__).with_name("family_labels.toml")
FAULTY = Path(__file__).with_name("faulty_policies.py")


@pytest.fixture
def lost(trace: Trace):  # type: ignore[no-untyped-def]
    """Return a rescue of 60 ticks in which only victim[1] is not rescued, with fields of boundaries by tick."""
    saved = [
        AdjudicatedEvent(id=f"e1-{n}", kind="rescued", tick=1, time_s=10.0, bindings=(f"victim[{n}]",)) for n in (2, 3)
    ]
    outcome = Outcome(success=False, reason="budget", scr=2 / 3, ticks=60, digest="", frames_digest="")

    def build(events: dict[int, dict[str, object]], reason: str = "budget") -> Trace:
        records: list[BoundaryRecord] = []
        for tick in range(61):
            fields = dict(events.get(tick, {}))
            if tick == 1:
                fields["events"] = (*saved, *fields.get("events", ()))  # type: ignore[misc]
            records.append(boundary(tick, **fields))
        return Trace(trace.path, trace.header, tuple(records), replace(outcome, reason=reason), True)  # type: ignore[arg-type]

    return build


def attributed(trace: Trace) -> Attribution:
    attribution = attribute(trace)
    assert attribution is not None
    return attribution


SEEN = {"frames": (frame("a", 5, "victim[1]"),)}
FOUND = {"messages": report(1, "a", 6), "events": (matched(6, "victim[1]", "m6-1"),)}
LOCATED = {
    "messages": FOUND["messages"],
    "events": (
        matched(6, "victim[1]", "m6-1"),
        AdjudicatedEvent(id="e6", kind="reported", tick=6, time_s=60.0, bindings=("victim[1]", "m6-1")),
    ),
}


def handed(tick: int) -> dict[str, object]:
    """Return the fields of a boundary in which the boat is assigned to victim[1], with the mission's stage."""
    message = Envelope(
        id=f"m{tick}-9", tick=tick, sender="scout[1]", recipient="skipper", kind="assignment", category="assignment",
        body={"assignee": "skipper", "target": "victim[1]"}, bytes=9, deliver_at=tick + 1,
    )  # fmt: skip
    return {
        "messages": (message,),
        "stages": (StageChange(stage="handoff", subject="victim[1]", tick=tick, time_s=10.0 * tick),),
        "snapshots": (at(tick, v1=(0.0, 0.0), boat=(900.0, 0.0)),),
    }


def test_an_unreported_target_in_a_picture_is_a_miss_at_that_picture(lost) -> None:  # type: ignore[no-untyped-def]
    attribution = attributed(lost({5: SEEN}))
    assert (attribution.family, attribution.target, attribution.tick) == ("perception_miss", "victim[1]", 5)
    assert [(link.kind, link.record) for link in attribution.chain] == [
        ("picture", "a"),
        ("agent", "scout[1]"),
        ("event", ""),
    ]
    late = {20: {"messages": report(1, "a", 20), "events": (matched(20, "victim[1]", "m20-1"),)}}
    assert attributed(lost({5: SEEN, **late})).chain[-1].text == "the first match came 15 ticks later"


def test_a_target_in_no_picture_is_a_miss_only_if_the_ticks_run_out(lost) -> None:  # type: ignore[no-untyped-def]
    attribution = attributed(lost({}))
    assert (attribution.family, attribution.tick) == ("perception_miss", 60)
    assert attributed(lost({}, reason="constraint")) == Attribution(family="unattributed")


def test_an_earlier_report_of_another_object_is_a_confusion(lost) -> None:  # type: ignore[no-untyped-def]
    buoy = Box(entity="buoy[1]", cls="buoy", box=(0.4, 0.4, 0.5, 0.5), pixels=40)
    attribution = attributed(
        lost({2: {"frames": (replace(frame("b", 2), boxes=(buoy,)),)}, 3: {"messages": report(1, "b", 3)}, 5: SEEN})
    )
    assert (attribution.family, attribution.tick) == ("object_confusion", 3)
    assert [(link.kind, link.record) for link in attribution.chain] == [("picture", "b"), ("message", "m3-1")]


@pytest.fixture
def real_rules(trace: Trace):  # type: ignore[no-untyped-def]
    """Return a synthetic trace with the rules, messages and stages of the shipped mission."""
    import lingjing
    from lingjing.testing import instantiate

    instance = instantiate(
        lingjing.compile(next(path for path in shipped_missions() if path.stem == "ssr")), seed=1, mode="broadcast"
    )

    def with_rules(there: Trace) -> Trace:
        own = there.header.instance
        mixed = replace(
            own, rules=instance.rules, messages=instance.messages, stages=instance.stages, success=instance.success
        )
        return Trace(there.path, replace(there.header, instance=mixed), there.boundaries, there.outcome, True)

    return with_rules


def test_a_matched_target_without_location_is_a_localisation_error(lost, real_rules) -> None:  # type: ignore[no-untyped-def]
    attribution = attributed(real_rules(lost({5: SEEN, 6: FOUND})))
    assert (attribution.family, attribution.tick) == ("localisation_error", 6)
    assert attribution.chain[0].record == "m6-1"


def test_a_target_matched_by_another_category_can_be_mislocated(lost, real_rules) -> None:  # type: ignore[no-untyped-def]
    """A mission may match messages of another category than `report`."""
    of_other_category = tuple(replace(message, category="other") for message in FOUND["messages"])
    attribution = attributed(real_rules(lost({5: SEEN, 6: {**FOUND, "messages": of_other_category}})))
    assert (attribution.family, [link.kind for link in attribution.chain]) == ("localisation_error", ["event"])


def test_a_located_target_assigned_late_or_never_is_a_handoff_break(lost, real_rules) -> None:  # type: ignore[no-untyped-def]
    attribution = attributed(real_rules(lost({5: SEEN, 6: LOCATED})))
    assert (attribution.family, attribution.tick, attribution.chain[-1].text) == ("handoff_break", 6, "never assigned")
    attribution = attributed(real_rules(lost({5: SEEN, 6: LOCATED, 30: handed(30)})))
    assert (attribution.family, attribution.chain[-1].text) == ("handoff_break", "assigned 24 ticks later")


def moves(tick: int, verb: str = "moveTo", reason: str = "", **arguments: object) -> dict[str, object]:
    made = DecisionRecord(agent="skipper", decision=Decision(command=Action(verb=verb, arguments=arguments)))  # type: ignore[arg-type]
    status = "rejected" if reason else "accepted"
    receipt = Receipt(request=f"c{tick}-1", tick=tick, sender="skipper", resource="boat", status=status, reason=reason)  # type: ignore[arg-type]
    return {"decisions": (made,), "receipts": (receipt,)}


def test_conflicts_over_an_assigned_body_are_a_deadlock(lost, real_rules) -> None:  # type: ignore[no-untyped-def]
    events = {5: SEEN, 6: LOCATED, 8: handed(8), 9: moves(9, reason="conflict"), 10: moves(10, reason="conflict")}
    attribution = attributed(real_rules(lost(events)))
    assert (attribution.family, attribution.tick) == ("coordination_deadlock", 9)
    assert [link.record for link in attribution.chain] == ["m8-9", "c9-1", "c10-1"]


def test_the_chain_names_the_assignment_of_the_target_among_several_of_one_boundary(lost, real_rules) -> None:  # type: ignore[no-untyped-def]
    fields = handed(8)
    other = replace(fields["messages"][0], id="m8-8", body={"assignee": "skipper", "target": "victim[2]"})  # type: ignore[index]
    both = {**fields, "messages": (other, *fields["messages"])}  # type: ignore[misc]
    events = {5: SEEN, 6: LOCATED, 8: both, 9: moves(9, reason="conflict"), 10: moves(10, reason="conflict")}
    assert [link.record for link in attributed(real_rules(lost(events))).chain] == ["m8-9", "c9-1", "c10-1"]


def test_a_request_of_the_kernel_is_no_assignment(lost, real_rules) -> None:  # type: ignore[no-untyped-def]
    """A route that the kernel requests may end at a target, but it is no assignment."""
    own = Command(id="k8-1", tick=8, sender="kernel", resource="boat", verb="moveTo", arguments={"x": 0.0, "y": 0.0})
    there = {"snapshots": (at(8, v1=(0.0, 0.0), boat=(900.0, 0.0)),)}
    refused = {9: moves(9, reason="conflict"), 10: moves(10, reason="conflict")}
    for origin, family in (("agent", "coordination_deadlock"), ("kernel", "unattributed")):
        fields = {**there, "commands": (replace(own, origin=origin),)}
        attribution = attributed(real_rules(lost({5: SEEN, 6: LOCATED, 8: fields, 14: handed(14), **refused})))
        assert attribution.family == family


def test_the_targets_of_a_rule_that_a_stage_waits_for_are_blocking(lost, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    def story(called: Call) -> families._Story:
        instance = trace.header.instance
        known = Call(function="emitted", arguments=(Symbol("rescue"), Ref("victim", "group")))
        rule = Rule(name="all_saved", parameters=(), condition=known)
        stages = (Stage(name="first", condition=called), Stage(name="second", condition=Flag(value=True)))
        relation = Relation(kind="dependency", source="first", target="second")
        changed = replace(instance, rules=(*instance.rules, rule), stages=stages, relations=(relation,))
        played = lost({})
        return families._Story(
            Trace(played.path, replace(played.header, instance=changed), played.boundaries, None, True)
        )

    assert set(story(Call(function="all_saved", rule=True)).blocking) == {"victim[1]", "victim[2]", "victim[3]"}
    assert story(Call(function="all_saved", rule=False)).blocking == ()


def test_an_assigned_body_that_goes_elsewhere_or_repeats_a_rejected_command_is_drift(lost, real_rules) -> None:  # type: ignore[no-untyped-def]
    other = {**moves(9, x=0.0, y=0.0), "snapshots": (at(9, v1=(500.0, 0.0), v2=(0.0, 0.0), boat=(900.0, 0.0)),)}
    attribution = attributed(real_rules(lost({5: SEEN, 6: LOCATED, 8: handed(8), 9: other})))
    assert (attribution.family, attribution.tick) == ("context_drift", 9)
    again = {tick: moves(tick, "moveTo", "unreachable", x=5000.0, y=0.0) for tick in range(9, 14)}
    attribution = attributed(real_rules(lost({5: SEEN, 6: LOCATED, 8: handed(8), **again})))
    assert (attribution.family, attribution.tick) == ("context_drift", 10)


def test_won_and_aborted_episodes_have_no_family_and_shares_add_up(lost, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    aborted = lost({}, reason="infrastructure-abort")
    assert attribute(trace) is None and attribute(aborted) is None
    played = [lost({5: SEEN}), lost({}), lost({}, reason="constraint"), trace, aborted]
    shares = Played(tuple(report_of(trace_of_episode, "someone") for trace_of_episode in played)).families()
    assert tuple(shares) == FAMILIES and sum(shares.values()) == pytest.approx(1.0)
    assert shares["perception_miss"] == 2 / 3 and shares["unattributed"] == 1 / 3
    assert Played((report_of(trace, "someone"),)).families() == {}


def test_the_explanation_has_the_family_with_its_records(lost) -> None:  # type: ignore[no-untyped-def]
    expected = "failure family: perception_miss of victim[1] from tick 5: victim[1] is visible (tick 5, a); "
    assert expected in why(lost({5: SEEN})).text


@pytest.mark.study
def test_the_agreement_of_rules_and_reader_is_as_documented(tmp_path: Path) -> None:
    """All labelled episodes are played. `docs/traces.md` has the numbers."""
    labels = tomllib.loads(LABELS.read_text(encoding="utf-8"))
    missions = {path.stem: path for path in shipped_missions()}
    pairs = []
    with Session() as session:
        for name, label in labels.items():
            mission, mode, policy, seed, *_ = name.split("-")
            how: dict[str, object] = {"policy": policy}
            if "planted" in label:
                how = {"policy": "faulty-oracle", "policy_args": {"faults": label["planted"]}}
            if "fault" in label:
                options = {"fault": label["fault"], "since": label["since"]}
                how = {"policy": f"{FAULTY}:FaultyOracle", "policy_args": options}
            done = session.run(
                missions[mission],
                mode=mode,
                seed=int(seed),
                out=tmp_path / name,
                overview=False,
                **how,  # type: ignore[arg-type]
            )
            attribution = attribute(read_trace(done.trace))
            assert attribution is not None, (name, done.reason, done.detail)  # the rules do not cover an abort
            pairs.append((label["family"], attribution.family))
    assert sum(first == second for first, second in pairs) >= AGREED
    assert kappa(pairs) >= KAPPA


def kappa(pairs: list[tuple[str, str]]) -> float:
    """Return Cohen's kappa of two raters: (observed - expected) / (1 - expected agreement)."""
    observed = sum(first == second for first, second in pairs) / len(pairs)
    ones, others = (Counter(pair[side] for pair in pairs) for side in (0, 1))
    expected = sum(ones[name] * others[name] for name in ones) / len(pairs) ** 2
    return (observed - expected) / (1.0 - expected)


def test_kappa_corrects_for_chance() -> None:
    """Eight of ten pairs agree, and both raters use a five times and b five times: (0.8 - 0.5) / 0.5."""
    pairs = [("a", "a")] * 4 + [("b", "b")] * 4 + [("a", "b"), ("b", "a")]
    assert kappa(pairs) == pytest.approx(0.6)


AGREED, KAPPA = 55, 0.85
"""Labels of `family_labels.toml` that the rules agree with, and Cohen's kappa."""


@pytest.mark.parametrize(
    ("variable", "field", "locates"), [("r", "place", True), ("r", "position", False), ("v", "position", False)]
)
def test_a_rule_may_locate_by_any_position_field_of_a_message(variable: str, field: str, locates: bool) -> None:
    """The position field of the message may have any name. The position of the target is no field of the report."""
    matched = Call(function="matched", arguments=(Ref("v", "local"), Ref("r", "local")), rule=True)
    inside = Binary("in", Attr(Ref(variable, "local"), field), Ref("search", "region"))
    rule = Rule(
        name="found",
        parameters=(RuleParameter(name="v", domain="victim"),),
        condition=Quantified("exists", "r", "sighting", Binary("and", matched, inside)),
    )
    sighting = MessageSpec(
        kind="sighting",
        type="sighting",
        category="report",
        fields=(Field(name="place", type="position"), Field(name="position", type="text")),
        senders=("all",),
        recipients=("all",),
    )
    instance = bare_instance((), rules=(rule,), messages=(sighting,))
    assert families._locating_rules(instance, frozenset({"matched"})) == (frozenset({"found"}) if locates else set())
