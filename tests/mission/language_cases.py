"""Variants of one small sea rescue: missions that cannot be won, and near ones that can.

Each variant is a list of lines to replace in the base mission (`language-cases/winnable/base.ljs`), and lines to add
before its `success`. Distances of the base: the boat is 350 m south of the search area and sails 3 m/s (3.3 m/s with
margins), the rescue reaches 50 m, so that it takes at least 90.9 s. The UAV begins at (300 m, -620 m).
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

BASE = (Path(__file__).parent / "language-cases" / "winnable" / "base.ljs").read_text("utf-8")

VICTIM = "target victim : person_in_water { hidden position ~ sites(search)  }"
UAV = "asset uav : quadrotor { position = (300 m, -620 m, 1 m) "
CAMERA = "camera nadir : nadir_hd"
ACTIONS = "actions { takeoff, setDestination, takePhoto } }"
BOAT = "asset boat : lifeboat { position = (10 m, -1350 m), heading = 30 deg  }"
SKIPPER = "agent skipper as rescuer controls boat { observes boat.*, events }"
MATCH = "when r.class == person_in_water and iou(r.box, truth(v, r.frame).box) >= 0.5"
UNLOCK = "unlock rescue(v: victim) when exists r: matched(v, r)"
RESCUED = "when emitted(rescue, v) and distance_xy(boat, v) <= 50 m"
REPORT = "message detection : report from searcher to all"
SCOUT = "observes uav.*, boat.position, events"
SUCCESS = "success when rescued(victim)"
BUDGET = "budget { ticks <= 60 }"
FAR = "target victim : person_in_water { hidden position ~ sites(box((-100 m, -1000 m), (-50 m, -950 m)))  }"
MIDST = "target victim : person_in_water { hidden position ~ sites(box((100 m, -850 m), (110 m, -840 m)))  }"
TWO = VICTIM.replace("victim :", "victim[1..2] :")
THREE = VICTIM.replace("victim :", "victim[1..3] :")
MODES = ("mode broadcast", "mode broadcast in { star, broadcast }")
HUB = "agent c as coordinator when mode == star { observes events }\n  comms { hub = c when mode == star }"
ORDER = "message order : assignment from searcher to rescuer"


class Variant(NamedTuple):
    """One variant of the base mission."""

    name: str
    changes: tuple[tuple[str, str], ...] = ()
    added: str = ""
    code: str = ""
    """The diagnostic code of an impossible variant."""

    @property
    def text(self) -> str:
        """The mission's text."""
        text = BASE
        for old, new in self.changes:
            assert text.count(old) >= 1, (self.name, old)
            text = text.replace(old, new, 1)
        return text.replace("  success when", f"  {self.added}\n  success when", 1)


def success(condition: str) -> tuple[tuple[str, str], ...]:
    """The base with another condition of success."""
    return ((SUCCESS, f"success when {condition}"),)


def also(condition: str) -> tuple[tuple[str, str], ...]:
    """The base with one more condition of success."""
    return success(f"rescued(victim) and {condition}")


def unlocked(condition: str) -> tuple[tuple[str, str], ...]:
    """The base with another condition of the rescue."""
    return ((UNLOCK, f"unlock rescue(v: victim) when {condition}"),)


IMPOSSIBLE = (
    # bounds on the time
    Variant("now-beyond-the-budget", also("now > 600 s"), code="LJ0612"),
    Variant("now-far-beyond-the-budget", also("now >= 601 s"), code="LJ0612"),
    Variant("now-before-the-start", also("now < 0 s"), code="LJ0612"),
    Variant("now-between-boundaries", also("now > 501 s and now < 509 s"), code="LJ0613"),
    Variant("now-too-early-for-the-way", also("now <= 90 s"), code="LJ0613"),
    Variant("now-shifted", also("now - 300 s > 300 s"), code="LJ0612"),
    Variant("now-scaled", also("2 * now > 1200 s"), code="LJ0612"),
    Variant("now-in-a-range-of-the-past", also("now in 0 s..50 s"), code="LJ0613"),
    Variant("unlock-before-the-boat-can-be-there", unlocked("now >= 600 s"), code="LJ0613"),
    Variant("rule-too-early", ((RESCUED, f"{RESCUED} and now < 60 s"),), code="LJ0613"),
    Variant("unlock-window-closed", unlocked("now > 620 s and now < 700 s"), code="LJ0612"),
    # contradictions
    Variant("rescued-and-not-rescued", also("not rescued(victim)"), code="LJ0612"),
    Variant("two-times", also("now > 300 s and now < 200 s"), code="LJ0613"),
    Variant(
        "near-and-far", also("distance_xy(boat, victim) <= 50 m and distance_xy(boat, victim) > 60 m"), code="LJ0612"
    ),
    Variant("north-and-south", also("boat.position.north > -900 m and boat.position.north < -1000 m"), code="LJ0612"),
    Variant("mode-that-is-not", (MODES, *also("mode == star")), HUB, "LJ0612"),
    Variant(
        "count-more-than-there-are", ((VICTIM, TWO), *success("count(rescued(v) for v in victim) >= 3")), code="LJ0612"
    ),
    Variant("count-below-zero", ((VICTIM, TWO), *success("count(rescued(v) for v in victim) < 0")), code="LJ0612"),
    Variant(
        "count-both",
        ((VICTIM, TWO), *success("count(rescued(v) for v in victim) >= 2 and not rescued(victim[1])")),
        code="LJ0612",
    ),
    Variant("status-of-two-kinds", also("boat.status == idle and boat.status == moving"), code="LJ0612"),
    Variant("confidence-below-its-bound", unlocked("exists r: matched(v, r) and r.confidence < 0"), code="LJ0612"),
    Variant("confidence-twice", unlocked("exists r: matched(v, r) and r.confidence * 2 > 3"), code="LJ0612"),
    Variant("iou-above-one-of-itself", ((MATCH, MATCH.replace(">= 0.5", "> 1")),), code="LJ0612"),
    Variant(
        "distance-below-zero", ((RESCUED, "when emitted(rescue, v) and distance_xy(boat, v) < 0 m"),), code="LJ0612"
    ),
    Variant(
        "in-two-regions",
        also("boat in a and boat in b"),
        "region a = box((0 m, -1400 m), (100 m, -1300 m))\n  region b = box((200 m, -1400 m), (300 m, -1300 m))",
        "LJ0612",
    ),
    Variant("heading-beyond-the-compass", also("boat.heading > 360 deg"), code="LJ0612"),
    Variant("too-far-away", also("distance_xy(boat, victim) > 9 km"), code="LJ0612"),
    # limits
    Variant("no-photo-allowed", (), "limit z <= 0 counts uav.takePhoto", "LJ0610"),
    Variant("no-report-allowed", (), "limit z <= 0 counts detection", "LJ0610"),
    Variant("nothing-of-the-boat-allowed", (), "limit z <= 0 counts boat.*", "LJ0610"),
    Variant("one-command-of-both", ((VICTIM, FAR),), "limit z <= 2 counts uav.*, boat.*", "LJ0610"),
    Variant("no-message-in-the-budget", ((BUDGET, "budget { ticks <= 60, messages <= 0 }"),), code="LJ0610"),
    Variant("no-token-in-the-budget", ((BUDGET, "budget { ticks <= 60, tokens <= 0 tokens }"),), code="LJ0206"),
    Variant("no-money-in-the-budget", ((BUDGET, "budget { ticks <= 60, money <= 0 USD }"),), code="LJ0206"),
    Variant("more-used-than-allowed", also("used(z) >= 3"), "limit z <= 2 counts boat.*", "LJ0612"),
    Variant("nothing-in-the-only-stage", (), "stage s { done when rescued(victim), limit z <= 0 counts boat.moveTo }"),
    # permits
    Variant("permit-false", (), "permit boat.moveTo when false", "LJ0612"),
    Variant("permit-after-the-budget", (), "permit boat.moveTo when now > 700 s", "LJ0613"),
    Variant("permit-too-late", (), "permit boat.moveTo when now >= 510 s", "LJ0613"),
    Variant("permit-in-the-past", (), "permit uav.takePhoto when now < 0 s"),
    Variant("permit-after-the-rescue", (), "permit boat.moveTo when rescued(victim)", "LJ0606"),
    Variant("permit-after-the-interaction", (), "permit boat.moveTo when emitted(rescue, victim)", "LJ0606"),
    Variant(
        "permits-in-a-circle",
        (),
        "permit boat.moveTo when photographed(uav)\n  permit uav.takePhoto when distance_xy(boat, victim) <= 50 m",
        "LJ0606",
    ),
    Variant("permit-of-everything", (), "permit uav.* when exists r: matched(victim, r)", "LJ0606"),
    Variant(
        "permit-of-a-late-match",
        (),
        "permit uav.takePhoto when now >= 500 s\n  permit boat.moveTo when exists r: matched(victim, r)",
        "LJ0613",
    ),
    # hard constraints
    Variant("constraint-north", (), "constraint hard c { always boat.position.north <= -1100 m }", "LJ0614"),
    Variant(
        "constraint-away",
        ((VICTIM, MIDST),),
        "constraint hard c { always distance_xy(boat, victim) >= 60 m }",
        "LJ0614",
    ),
    Variant(
        "constraint-in-harbour",
        (),
        "region harbour = box((-100 m, -1400 m), (100 m, -1300 m))\n  constraint hard c { always boat in harbour }",
        "LJ0614",
    ),
    Variant("constraint-of-the-time", (), "constraint hard c { always now < 60 s }"),
    Variant(
        "constraint-broken-at-the-start", (), "constraint hard c { always boat.position.north >= -1200 m }", "LJ0511"
    ),
    Variant("constraint-on-the-rescue", (), "constraint hard c { always not emitted(rescue, victim) }", "LJ0614"),
    Variant("constraint-on-pictures", (), "constraint hard c { always not photographed(uav) }", "LJ0614"),
    Variant("constraint-on-matches", (), "constraint hard c { always not exists r: matched(victim, r) }", "LJ0614"),
    Variant("constraint-before-anything", (), "constraint hard c { always exists r: matched(victim, r) }", "LJ0511"),
    # presence
    Variant("appears-at-the-end", (), "event g at 60 tick { appear victim }", "LJ0613"),
    Variant("vanishes-at-once", (), "event g at 0 tick { vanish victim }", "LJ0613"),
    Variant("vanishes-before-the-boat-comes", (), "event g at 60 s { vanish victim }", "LJ0613"),
    Variant(
        "appears-and-vanishes",
        (),
        "event g at 20 tick { appear victim }\n  event h at 21 tick { vanish victim }",
        "LJ0613",
    ),
    # failures
    Variant("failure-at-the-start", (), "failure when now >= 0 s", "LJ0511"),
    Variant("failure-too-early", (), "failure when now >= 80 s", "LJ0601"),
    Variant("failure-of-a-match", (), "failure when exists r: matched(victim, r)", "LJ0613"),
    Variant("failure-of-a-picture", (), "failure when photographed(uav)", "LJ0613"),
    Variant("failure-without-a-match", (), "failure when not exists r: matched(victim, r)", "LJ0511"),
    Variant("failure-or-time", (), "failure when not alive(uav) or now > 50 s", "LJ0601"),
    Variant("stage-too-short", (), "stage s { done when rescued(victim), ticks <= 5 }", "LJ0601"),
    Variant("stage-of-the-match-too-short", (), "stage s { done when exists r: matched(victim, r), ticks <= 1 }"),
    # elevation
    Variant("elevation-above-the-band", also("uav.position.elevation > 200 m"), code="LJ0612"),
    Variant("elevation-under-water", also("uav.position.elevation < -50 m"), code="LJ0612"),
    Variant("boat-in-the-air", also("boat.position.elevation > 50 m"), code="LJ0612"),
    Variant(
        "takeoff-too-low-to-see",
        ((VICTIM, FAR), (ACTIONS, "actions { takeoff, up, down, takePhoto } }")),
        code="LJ0607",
    ),
    # status
    Variant("status-that-no-engine-gives", also('boat.status == "flying"'), code="LJ0109"),
    Variant("status-of-a-victim", also('victim.status == "burning"'), code="LJ0109"),
    # payloads
    Variant("payload-of-60-bytes", (), "comms { payload <= 60 B }", "LJ0605"),
    # actors
    Variant(
        "a-role-without-an-agent-reports", (MODES, (REPORT, REPORT.replace("searcher", "coordinator"))), HUB, "LJ0605"
    ),
    Variant(
        "victim-out-of-the-way",
        ((VICTIM, VICTIM.replace("sites(search)", "sites(box((2500 m, 2500 m), (2600 m, 2600 m)))")),),
        code="LJ0601",
    ),
    Variant(
        "default-mode-cannot", (MODES,), f"{HUB}\n  limit z <= 0 counts boat.moveTo when mode == broadcast", "LJ0610"
    ),
    # learnt from attacks on the proofs
    Variant("permit-of-its-own-place", (), "permit boat.moveTo when boat in search", "LJ0606"),
    Variant("permit-of-its-own-motion", (), "permit boat.moveTo when boat.status == moving", "LJ0606"),
    Variant("permit-of-its-own-height", (), "permit uav.* when uav.position.elevation > 50 m", "LJ0606"),
    Variant(
        "permit-of-a-match-far-away",
        ((VICTIM, FAR),),
        "permit uav.setDestination when exists r: matched(victim, r)",
        "LJ0606",
    ),
    Variant("constraint-low", ((VICTIM, FAR),), "constraint hard c { always uav.position.east >= 250 m }", "LJ0614"),
    Variant(
        "constraint-on-a-count",
        (),
        "limit z <= 5 counts boat.moveTo\n  constraint hard c { always used(z) <= 0 }",
        "LJ0614",
    ),
    Variant("failure-of-a-count", (), "limit z <= 5 counts uav.takePhoto\n  failure when used(z) >= 1", "LJ0613"),
    Variant(
        "confidence-in-two-ranges",
        unlocked("exists r: matched(v, r) and r.confidence > 0.5 and r.confidence < 0.4"),
        code="LJ0612",
    ),
    Variant("two-classes", ((MATCH, f"{MATCH} and r.class == lifeboat"),), code="LJ0612"),
    Variant("payload-below-the-class", (), "comms { payload <= 90 B }", "LJ0605"),
    Variant("battery-of-seconds", ((UAV, f"{UAV}, endurance = 10 s "), (VICTIM, FAR)), code="LJ0603"),
    Variant("no-budget-of-messages", ((SCOUT, f"{SCOUT}\n    budget {{ messages <= 0 }}"),), code="LJ0610"),
    Variant("early-or-late", success("(rescued(victim) and now < 5 s) or now > 700 s"), code="LJ0613"),
    Variant("sum-of-what-stays", success("sum(v.drift for v in victim) > 1 m/s"), code="LJ0612"),
    Variant("property-that-stays", also("victim.drift > 1 m/s"), code="LJ0612"),
    Variant("success-false", success("false")),
)

ABOVE = "asset uav : quadrotor { position = (105 m, -845 m, 60 m) "
TICKING = (CAMERA, f"{CAMERA} {{ capture = each_tick }}")
HARBOUR = "region harbour = box((-300 m, -1600 m), (400 m, -600 m))"
SECOND_UAV = f"""{UAV.replace("uav :", "spare :").replace("300 m", "310 m")}
    {CAMERA}
    {ACTIONS}
  agent wing as searcher controls spare {{ observes spare.*, events }}"""
SECOND_BOAT = f"""{BOAT.replace("boat :", "tender :").replace("10 m", "60 m")}
  agent mate as rescuer controls tender {{ observes tender.*, events }}"""
CLOCKS = (
    *("now >= 0 s", "now >= 100 s", "now >= 599 s", "now >= 600 s", "now > 599 s", "now == 600 s", "now <= 600 s"),
    *("now < 601 s", "not now > 600 s", "not now < 600 s", "now in 100 s..600 s", "now - 300 s >= 300 s"),
    *("2 * now >= 1200 s", "600 s <= now", "now / 2 >= 300 s", "(now >= 600 s or now < 0 s)", "not (now < 5 s)"),
    *("now > 501 s and now < 511 s", "now >= 10 s * 12", "-now <= -600 s"),
)
STATES = (
    *("boat.status == moving", "boat.status == idle", "not boat.status == aground", "boat.status != aground"),
    *("uav.status == grounded", "victim.status == rescued", "uav.status == hovering", "alive(boat)"),
    *("not (boat.status == idle and boat.status == moving)", "boat.heading <= 360 deg", "boat.heading >= 0 deg"),
    *("uav.position.elevation > 100 m", "uav.position.elevation >= 120 m", "uav.position.elevation < 2 m"),
    *("boat.position.north >= -1040 m", "boat.position.east > 200 m", "distance_xy(boat, uav) > 1 km"),
    *("distance_xy(boat, victim) < 30 m", "distance_xy(uav, victim) <= 10 m", "victim in search", "boat in search"),
    *("not boat in search", "victim.drift <= 1 m/s", "photographed(uav)", "assigned(boat, victim)"),
    *("not (rescued(victim) and now < 5 s)", "(rescued(victim) or not rescued(victim))", "not photographed(boat)"),
)
FAILURES = (
    *("now >= 600 s", "now > 600 s", "now > 400 s", "rescued(victim)", "emitted(rescue, victim)", "not alive(uav)"),
    *("distance_xy(boat, victim) <= 50 m", "exists r: matched(victim, r) and now > 500 s", "photographed(boat)"),
    *("photographed(uav) and now < 30 s", "(not exists r: matched(victim, r)) and now > 400 s", "boat in search"),
    *("victim.status == rescued", "now < 0 s", "uav.position.elevation > 115 m", "boat.status == aground"),
)
PERMITS = (
    *("boat.moveTo when exists r: matched(victim, r)", "boat.moveTo when photographed(uav)", "boat.* when now < 500 s"),
    *("boat.moveTo when not rescued(victim)", "boat.moveTo when now >= 400 s", "uav.takePhoto when now >= 300 s"),
    *("uav.takePhoto when uav.position.elevation > 50 m", "uav.* when now > 0 s", "uav.takeoff when false"),
    *("boat.moveTo when true", "boat.moveTo when not photographed(uav)", "boat.moveTo when now > 20 s and now < 40 s"),
    "uav.takePhoto when distance_xy(boat, uav) > 300 m",
)
CONSTRAINTS = (
    *("now <= 600 s", "now < 601 s", "boat.position.north <= -600 m", "boat.position.north >= -1400 m"),
    *("distance_xy(boat, victim) >= 0 m", "distance_xy(boat, victim) >= 40 m", "uav.position.elevation <= 130 m"),
    *(
        "alive(boat)",
        "boat in harbour",
        "not boat in search",
        "distance_xy(boat, uav) <= 3 km",
        "not photographed(boat)",
    ),
    *("now < 5 s or alive(boat)", "not boat.status == aground", "boat.position.east in -500 m..500 m"),
)
LIMITS = (
    *("limit z <= 1 counts boat.moveTo", "limit z <= 1 counts boat.*", "limit z <= 2 counts uav.*"),
    *("limit z <= 3 counts uav.*, boat.*", "limit z <= 1 counts uav.takePhoto", "limit z <= 0 counts uav.takeoff"),
    *("limit z <= 1 counts uav.takePhoto, uav.takeoff", "limit z <= 2 counts detection, boat.moveTo"),
    *("comms { payload <= 120 B }", "comms { loss = 100 % }", "comms { range <= 1 m }", "comms { delay = 9 tick }"),
)
EVENTS = (
    *(
        "event g at 10 tick { appear victim }",
        "event g at 30 s { appear victim }",
        "event g at 40 tick { vanish victim }",
    ),
    *("event g at 60 tick { vanish victim }", "event g at 100 tick { vanish victim }"),
    "event g at 5 tick { appear victim }\n  event h at 55 tick { vanish victim }",
    "event g at ~ uniform(2 tick, 100 tick) { appear victim }",
    "event g at 3 tick { weather { wind = 3 m/s from 10 deg } }",
)
STAGES = (
    "stage a { done when rescued(victim) }\n  stage b { done when now > 5 s }\n  relation dependency a <-> b",
    "stage s { done when now > 700 s, ticks <= 30 }",
    "stage s { done when now > 700 s }",
    "stage s { done when exists r: matched(victim, r), limit z <= 0 counts boat.moveTo }",
    "stage s { done when photographed(uav), limit z <= 0 counts boat.moveTo }",
    (
        "stage a { done when photographed(uav) }\n  "
        "stage b { done when now > 900 s, ticks <= 20 }\n  "
        "relation dependency a -> b"
    ),
    "constraint soft c { always not boat in search, penalty = 0.1 }",
    (
        "stage a { done when rescued(victim), limit z <= 0 counts boat.moveTo }\n  "
        "stage b { done when now > 5 s }\n  "
        "relation dependency a <-> b"
    ),
)

WINNABLE = (
    *(Variant(f"clock {each}", also(each)) for each in CLOCKS),
    *(Variant(f"state {each}", also(each)) for each in STATES),
    *(Variant(f"failure {each}", (), f"failure when {each}") for each in FAILURES),
    *(Variant(f"permit {each}", (), f"permit {each}") for each in PERMITS),
    *(Variant(f"hard {each}", (), f"{HARBOUR}\n  constraint hard c {{ always {each} }}") for each in CONSTRAINTS),
    *(Variant(f"limit {each}", ((VICTIM, FAR),), each) for each in LIMITS),
    *(Variant(f"event {each}", (), each) for each in EVENTS),
    *(Variant(f"stage {each}", (), each) for each in STAGES),
    Variant("unlock-at-the-last-moment", unlocked("now >= 590 s")),
    Variant("unlock-of-a-match-at-the-last-moment", unlocked("now > 589 s and exists r: matched(v, r)")),
    Variant("rule-in-time", ((RESCUED, f"{RESCUED} and now < 150 s"),)),
    Variant("confidence-of-one", unlocked("exists r: matched(v, r) and r.confidence >= 1")),
    Variant("confidence-of-zero", unlocked("exists r: matched(v, r) and r.confidence <= 0")),
    Variant("iou-of-one", ((MATCH, MATCH.replace(">= 0.5", ">= 1")),)),
    Variant(
        "two-reports",
        unlocked("exists r: exists q in detection: matched(v, r) and r.confidence > 0.5 and q.confidence < 0.4"),
    ),
    Variant(
        "a-report-that-does-not-match", unlocked("exists r: matched(v, r) and exists q in detection: not matched(v, q)")
    ),
    Variant("count-of-two", ((VICTIM, TWO), *success("count(rescued(v) for v in victim) == 2"))),
    Variant("count-above-zero", ((VICTIM, TWO), *success("count(rescued(v) for v in victim) > 0"))),
    Variant(
        "count-at-most", ((VICTIM, THREE), *success("rescued(victim[1]) and count(rescued(v) for v in victim) < 3"))
    ),
    Variant("nearest", ((VICTIM, TWO), *success("min(distance_xy(boat, v) for v in victim) <= 50 m"))),
    Variant("all", ((VICTIM, TWO), *success("forall v in victim: rescued(v)"))),
    Variant(
        "not-all", ((VICTIM, TWO), *success("(exists v in victim: rescued(v)) and not forall v in victim: rescued(v)"))
    ),
    Variant(
        "failure-of-another",
        ((VICTIM, TWO), *success("rescued(victim[1])")),
        "failure when exists r: matched(victim[2], r)",
    ),
    Variant("match-is-both", success("exists r: matched(victim, r)"), "failure when exists r: matched(victim, r)"),
    Variant("picture-is-both", success("photographed(uav)"), "failure when photographed(uav)"),
    Variant("no-boat-needed", success("exists r: matched(victim, r)"), "permit boat.moveTo when rescued(victim)"),
    Variant("no-picture-needed", unlocked("now > 50 s"), "permit uav.takePhoto when false"),
    Variant(
        "constraint-on-another",
        ((VICTIM, TWO), *success("rescued(victim[1])")),
        "constraint hard c { always not emitted(rescue, victim[2]) }",
    ),
    Variant("either-permit-or-time", success("rescued(victim) or now > 30 s"), "permit boat.moveTo when false"),
    Variant("by-itself", ((VICTIM, FAR), TICKING), "limit z <= 1 counts uav.*"),
    Variant("in-sight-from-the-start", ((VICTIM, MIDST), (UAV, ABOVE)), "limit z <= 1 counts uav.*"),
    Variant("in-sight-by-itself", ((VICTIM, MIDST), (UAV, ABOVE), TICKING), "limit z <= 0 counts uav.*"),
    Variant("in-sight-without-flight", ((VICTIM, MIDST), (UAV, ABOVE), (ACTIONS, "actions { takePhoto } }"))),
    Variant("another-uav", ((VICTIM, FAR),), f"{SECOND_UAV}\n  limit z <= 0 counts uav.*"),
    Variant(
        "another-boat",
        (),
        f"{SECOND_BOAT}\n  "
        f"permit boat.moveTo when false\n  "
        f"constraint hard c {{ always boat.position.north <= -1300 m }}",
    ),
    Variant(
        "another-boat-rescues",
        ((RESCUED, "when emitted(rescue, v)"),),
        f"{SECOND_BOAT}\n  "
        f"permit boat.moveTo when false\n  "
        f"constraint hard c {{ always boat.position.north <= -1300 m }}",
    ),
    Variant("used-as-allowed", also("used(z) >= 1"), "limit z <= 1 counts boat.moveTo"),
    Variant(
        "no-message-of-the-skipper", ((SKIPPER, SKIPPER.replace("events }", "events\n budget { messages <= 0 } }")),)
    ),
    Variant("a-token", ((BUDGET, "budget { ticks <= 60, tokens <= 1 tokens, money <= 0.01 USD, messages <= 1 }"),)),
    Variant("permit-of-a-place-nearby", (), "permit boat.moveTo when boat.position.north < -1300 m"),
    Variant("permit-of-a-height-on-the-ground", (), "permit uav.* when uav.position.elevation < 50 m"),
    Variant("permit-of-a-climb", (), "permit uav.setDestination when uav.position.elevation > 5 m"),
    Variant("permit-of-a-climb-in-the-air", ((UAV, ABOVE),), "permit uav.* when uav.position.elevation > 50 m"),
    Variant("count-may-rise", (), "limit z <= 5 counts boat.moveTo\n  constraint hard c { always used(z) <= 1 }"),
    Variant("failure-of-two", (), "limit z <= 5 counts uav.takePhoto\n  failure when used(z) >= 2"),
    Variant(
        "ranges-of-two-reports",
        unlocked("(exists r: matched(v, r) and r.confidence > 0.5) and exists q in detection: q.confidence < 0.4"),
    ),
    Variant("payload-of-the-class", (), "comms { payload <= 100 B }"),
    Variant("battery-of-a-minute", ((UAV, f"{UAV}, endurance = 60 s "), (VICTIM, FAR))),
    Variant("assigned-late", also("assigned(boat, victim)"), f"{ORDER}\n  permit boat.moveTo when now > 200 s"),
    Variant("default-mode-can", (MODES,), f"{HUB}\n  limit z <= 0 counts boat.moveTo when mode == star"),
    Variant(
        "default-mode-appears",
        (MODES,),
        f"{HUB}\n  "
        f"event g at 70 tick when mode == star {{ appear victim }}\n  "
        f"event h at 3 tick when mode == broadcast {{ appear victim }}",
    ),
    Variant(
        "drifts-in",
        ((VICTIM, FAR.replace("{ hidden", "{ drift = 0.5 m/s, hidden")),),
        "weather { current = 0.5 m/s to 90 deg }\n  constraint hard c { always boat.position.east >= -10 m }",
    ),
    Variant(
        "blown",
        ((ACTIONS, "actions { takeoff, setDestination, takePhoto } }"),),
        "weather { wind = 10 m/s from 20 deg, wave_height ~ uniform(0.2 m, 2 m) }",
    ),
)
