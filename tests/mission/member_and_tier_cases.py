"""Missions with members of groups, tiers, goods and radio: some cannot be won, near ones can.

Variants of the sea rescue of `language_cases`, and of a delivery by road: a van with 200 kg begins at a warehouse, and
a shop 500 m away demands goods. Its bodies stand at most 60 m from their declared places.
"""

from __future__ import annotations

from typing import NamedTuple

from tests.mission.language_cases import (
    BOAT,
    BUDGET,
    SUCCESS,
    THREE,
    TWO,
    VICTIM,
    Variant,
    also,
    success,
    unlocked,
)

SEEN = "exists r: matched(victim, r)"
AREA = "  region search"
DEPOT = ("target depot : warehouse { position = (0 m, 0 m) }", "")
NO_DEPOT = (DEPOT, (", depot.*", ""))
SH = "demand = 100 kg }"
LAND = """ljs 2
use std.ground { delivery_van, car, robot_dog }
use std.logistics { delivery_point, warehouse }
use std.traffic { destination }
use std.fire { fire_source }
use std.messages { status }
mission cargo "Cargo" {
  goal "Deliver."
  scene logistics { extent = 1500 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 60 }
  mode broadcast
  region yard = box((-20 m, -20 m), (20 m, 20 m))
  region far = box((480 m, -30 m), (520 m, 30 m))
  target depot : warehouse { position = (0 m, 0 m) }
  target shop : delivery_point { position = (500 m, 0 m), demand = 100 kg }
  asset van : delivery_van { position = (0 m, 0 m) }
  agent driver as driver controls van { observes van.*, shop.*, depot.* }
  @L@
  success when @S@
}
"""


class LandVariant(NamedTuple):
    """One variant of the delivery."""

    name: str
    text: str


def land(
    name: str, line: str = "", s: str = "shop.demand <= 0 kg", ch: tuple[tuple[str, str], ...] = ()
) -> LandVariant:
    """The delivery with one more line, another success, and replacements."""
    text = LAND.replace("@L@", line).replace("@S@", s)
    for old, new in ch:
        assert old in text, (name, old)
        text = text.replace(old, new, 1)
    return LandVariant(name, text)


def param(text: str) -> tuple[tuple[str, str], ...]:
    """The base with a param, which stands before the regions."""
    return ((AREA, f"  param {text}\n{AREA}"),)


IMPOSSIBLE = (
    # -- goods
    land("demand-beyond-no-depot", ch=((SH, "demand = 100 t }"),)),
    land("demand-no-depot", ch=(*NO_DEPOT, (SH, "demand = 300 kg }"))),
    land("demand-negative", s="shop.demand < 0 kg"),
    land("load-above-payload", s="shop.demand <= 0 kg and van.load > 201 kg"),
    land("load-and-no-load", s="van.load > 100 kg and van.load < 50 kg"),
    land(
        "status-and-event",
        "event shut at 0 tick { change depot.status to dormant }",
        s="depot.status == served and shop.demand <= 0 kg",
    ),
    # -- group and member
    Variant(
        "all-and-not-one", ((VICTIM, TWO), *success("(forall v in victim: rescued(v)) and not rescued(victim[1])"))
    ),
    Variant("none-and-one", ((VICTIM, TWO), *success("(forall v in victim: not rescued(v)) and rescued(victim[2])"))),
    Variant(
        "exists-and-none",
        ((VICTIM, TWO), *success("(exists v in victim: rescued(v)) and (forall v in victim: not rescued(v))")),
    ),
    Variant(
        "all-far-one-near",
        (
            (VICTIM, TWO),
            *success(
                "rescued(victim[1]) and (forall v in victim: distance_xy(boat, v) > 100 m) and "
                "distance_xy(boat, victim[2]) < 50 m"
            ),
        ),
    ),
    Variant(
        "min-above-member",
        (
            (VICTIM, TWO),
            *success(
                "rescued(victim[1]) and min(distance_xy(boat, v) for v in victim) > 80 m and "
                "distance_xy(boat, victim[1]) < 60 m"
            ),
        ),
    ),
    Variant(
        "max-below-member",
        (
            (VICTIM, TWO),
            *success(
                "rescued(victim[1]) and max(distance_xy(boat, v) for v in victim) < 50 m and "
                "distance_xy(boat, victim[1]) > 60 m"
            ),
        ),
    ),
    Variant(
        "count-all-but-not-one",
        ((VICTIM, THREE), *success("count(rescued(v) for v in victim) == 3 and not rescued(victim[3])")),
    ),
    Variant(
        "count-none-but-one",
        ((VICTIM, THREE), *success("count(rescued(v) for v in victim) == 0 and rescued(victim[3])")),
    ),
    Variant(
        "count-2-of-3-not-two",
        (
            (VICTIM, THREE),
            *success("count(rescued(v) for v in victim) >= 2 and not rescued(victim[1]) and not rescued(victim[2])"),
        ),
    ),
    Variant(
        "not-exists-and-member",
        ((VICTIM, TWO), *success("not (exists v in victim: rescued(v)) and rescued(victim[1])")),
    ),
    Variant(
        "not-forall-and-all",
        ((VICTIM, TWO), *success("not (forall v in victim: rescued(v)) and rescued(victim[1]) and rescued(victim[2])")),
    ),
    Variant("sum-of-flags", ((VICTIM, TWO), *success("sum(distance_xy(boat, v) / 1 m for v in victim) < 0"))),
    # -- tiers
    Variant("tier-too-short", (*param("n = 60\n  tier 1 { n = 3 }"), (BUDGET, "budget { ticks <= n }"))),
    Variant(
        "tier-switch-contradiction",
        (*param("hard = false\n  tier 1 { hard }"), *success("rescued(victim) and (not hard or now > 700 s)")),
    ),
    Variant(
        "tier-far-boat",
        (
            *param("d = 0 m\n  tier 1 { d = 9 km }"),
            (BOAT, "asset boat : lifeboat { position = (10 m, -1350 m - d), heading = 30 deg }"),
        ),
    ),
    Variant("tier-permit-late", (*param("t = 0 s\n  tier 1 { t = 590 s }"),), "permit boat.moveTo when now >= t"),
    Variant(
        "tier-alternative",
        (
            *param("odd = false\n  tier 1 { odd }"),
            (
                BOAT,
                (
                    "asset boat : lifeboat { position = (10 m, -1350 m), position = (10 m, -9350 m) when "
                    "odd, heading = 30 deg }"
                ),
            ),
        ),
    ),
    Variant("tier-limit-0", (*param("m = 9\n  tier 1 { m = 0 }"),), "limit moves <= m counts boat.moveTo"),
    Variant(
        "tier-claims-evidence",
        (
            *param("ev = false\n  tier 1 { ev }"),
            (SUCCESS, "success when rescued(victim) and (not ev or photographed(uav) and now < 9 s)"),
        ),
    ),
    # -- params and switches
    Variant("switch-false-needed", (*param("x = false"), *also("x"))),
    Variant("switch-both", (*param("x = true"), *also("x and not x"))),
    Variant("param-time", (*param("t = 700 s"), *also("now > t"))),
    Variant("require-never", (*param("n ~ integer(1, 3)"),), 'require n > 5 because "x"'),
    Variant(
        "sites-along-far",
        (
            (
                VICTIM,
                (
                    "target victim : person_in_water { hidden position ~ sites_along([(2500 m, -900 m), "
                    "(2900 m, -900 m)]) }"
                ),
            ),
        ),
    ),
    Variant(
        "sites-along-too-many",
        (
            (
                VICTIM,
                (
                    "target victim[1..9] : person_in_water { hidden position ~ sites_along([(0 m, -1000 "
                    "m), (100 m, -1000 m)], apart >= 40 m) }"
                ),
            ),
            *success("rescued(victim[1])"),
        ),
    ),
    # -- events
    Variant(
        "radio-off-before-order",
        unlocked("exists q in order: true"),
        "message order : assignment from searcher to rescuer\n event e at 0 tick { comms { loss = 100 % } }",
    ),
    Variant("vanish-before", (), "event e at 5 tick { vanish victim }"),
    Variant(
        "event-ends-before",
        unlocked("count(e) >= 2"),
        "event e at 100 s until now > 200 s { weather { cloud = 20 % } }",
    ),
    Variant(
        "event-chain-late",
        unlocked("count(f) >= 1"),
        "event e at 300 s { weather { cloud = 20 % } }\n "
        "event f when held(count(e) >= 1, 310 s) { weather { cloud = 30 % } }",
    ),
    # -- sensors & messages
    Variant("claims-late", unlocked("exists r: matched(v, r) and r.sent > 595 s")),
    Variant("sender-not-there", unlocked("exists r: matched(v, r) and r.role == rescuer")),
    Variant("battery-full-flight", also("uav.battery > 100 %")),
    Variant("battery-empty-and-full", also("uav.battery < 20 % and uav.battery > 80 %")),
    Variant("los-self", also("distance(boat, uav) < 0 m")),
    Variant("uav-under-water", also("uav.position.elevation < -50 m")),
    Variant("uav-above-band", also("uav.position.elevation > 900 m")),
    Variant("held-vs-budget", success("held(rescued(victim), 520 s)")),
    Variant("before-vs-within", also("within(now > 100 s, now > 200 s, 60 s)")),
    Variant("before-order", also("before(rescued(victim), emitted(rescue, victim)) and emitted(rescue, victim)")),
    Variant(
        "serial-late",
        also("now > 500 s"),
        "stage a { done when now > 300 s }\n "
        " stage b { done when rescued(victim), ticks <= 3 }\n "
        " serial a, b\n "
        "stage c { done when now > 450 s, ticks <= 4}\n "
        "serial b, c",
    ),
    Variant("used-more-than-limit", also("used(l) >= 4"), "limit l <= 3 counts boat.moveTo"),
    Variant("hard-and-goal", (), "constraint hard c { always distance_xy(boat, victim) > 55 m }"),
    Variant("hard-count", (), "constraint hard c { always count(rescue) < 1 }"),
    Variant("hard-status", (), "constraint hard c { always victim.status != rescued }"),
    Variant("hard-held", (), "constraint hard c { always not held(now > 20 s, 30 s) }"),
    Variant("fail-when-photo", (), "failure when photographed(uav)"),
    Variant("fail-when-move", (), "failure when boat.position.north > -1340 m"),
    Variant("permit-circular-photo", (), "permit uav.takePhoto when emitted(rescue, victim)"),
    Variant("deadline-stage-early", (), "stage s { done when rescued(victim), deadline = 80 s }"),
)

WINNABLE = (
    land("base"),
    land("close-elsewhere", "region gate = box((100 m, 700 m), (140 m, 740 m))\n event c at 0 tick { close gate }"),
    land("close-later", "region gate = box((100 m, -2000 m), (140 m, 2000 m))\n event c at 400 s { close gate }"),
    land(
        "close-until",
        "region gate = box((100 m, -2000 m), (140 m, 2000 m))\n event c at 0 tick until now > 100 s { close gate }",
    ),
    land(
        "close-reopen",
        "region gate = box((100 m, -2000 m), (140 m, 2000 m))\n "
        "event c at 0 tick { close gate }\n "
        "event o at 10 tick { reopen gate }",
    ),
    land("close-one-street", "region gate = box((100 m, -8 m), (140 m, 8 m))\n event c at 0 tick { close gate }"),
    land(
        "close-shop-within-radius", "region gate = box((495 m, -5 m), (505 m, 5 m))\n event c at 0 tick { close gate }"
    ),
    land(
        "close-when-late",
        "region gate = box((100 m, -2000 m), (140 m, 2000 m))\n event c when shop.demand <= 0 kg { close gate }",
    ),
    land("demand-raised-some", "event more at 100 s { change shop.demand to 300 kg }"),
    land("demand-lowered", "event less at 100 s { change shop.demand to 10 kg }", ch=((SH, "demand = 90 t }"),)),
    land("demand-lowered-0", "event less at 100 s { change shop.demand to 0 kg }", ch=((SH, "demand = 90 t }"),)),
    land("demand-repeat-rarely", "event more at 10 s repeat every 200 s { change shop.demand to 100 kg }"),
    land("demand-raise-after", "event more when shop.demand <= 0 kg { change shop.demand to 100 kg }"),
    land("demand-big", ch=((SH, "demand = 600 kg }"),)),
    land("demand-relative", "event more at 50 s { change shop.demand to shop.demand + 100 kg }"),
    land("demand-until", "event more at 50 s until now > 200 s { change shop.demand to 90 t }"),
    land("load-payload", s="shop.demand <= 0 kg and van.load > 199 kg"),
    land("load-moments", s="van.load < 150 kg and shop.demand <= 0 kg"),
    land("van-speed", s="shop.demand <= 0 kg and speed(van) < 60 m/s"),
    land("van-in-far", s="van in far"),
    land("no-depot-just", ch=(*NO_DEPOT, (SH, "demand = 200 kg }"))),
    land("no-depot-event", "event more at 5 tick { change shop.demand to 100 kg }", ch=NO_DEPOT),
    Variant("all-and-one", ((VICTIM, TWO), *success("(forall v in victim: rescued(v)) and rescued(victim[1])"))),
    Variant("one-not-other", ((VICTIM, TWO), *success("rescued(victim[1]) and not rescued(victim[2])"))),
    Variant(
        "exists-not-all",
        ((VICTIM, TWO), *success("(exists v in victim: rescued(v)) and not (forall v in victim: rescued(v))")),
    ),
    Variant(
        "count-2-of-3-not-one",
        ((VICTIM, THREE), *success("count(rescued(v) for v in victim) >= 2 and not rescued(victim[1])")),
    ),
    Variant(
        "count-exact", ((VICTIM, THREE), *success("count(rescued(v) for v in victim) == 1 and rescued(victim[3])"))
    ),
    Variant(
        "min-max",
        (
            (VICTIM, TWO),
            *success(
                "rescued(victim[1]) and min(distance_xy(boat, v) for v in victim) < 60 m and "
                "max(distance_xy(boat, v) for v in victim) > 60 m"
            ),
        ),
    ),
    Variant(
        "min-of-other",
        (
            (VICTIM, TWO),
            *success(
                "rescued(victim[1]) and min(distance_xy(boat, v) for v in victim) < 80 m and "
                "distance_xy(boat, victim[1]) > 90 m"
            ),
        ),
    ),
    Variant(
        "forall-or", ((VICTIM, TWO), *success("(forall v in victim: rescued(v) or now > 1 s) and rescued(victim[1])"))
    ),
    Variant(
        "not-exists-other",
        ((VICTIM, TWO), *success("not (exists v in victim: distance_xy(boat, v) > 3 km) and rescued(victim[1])")),
    ),
    Variant("tier-shorter", (*param("n = 60\n  tier 1 { n = 50 }"), (BUDGET, "budget { ticks <= n }"))),
    Variant(
        "tier-switch",
        (*param("hard = false\n  tier 1 { hard }"), *success("rescued(victim) and (not hard or now > 300 s)")),
    ),
    Variant(
        "tier-nearer",
        (
            *param("d = 0 m\n  tier 1 { d = 100 m }"),
            (BOAT, "asset boat : lifeboat { position = (10 m, -1350 m - d), heading = 30 deg }"),
        ),
    ),
    Variant("tier-permit", (*param("t = 0 s\n  tier 1 { t = 300 s }"),), "permit boat.moveTo when now >= t"),
    Variant("tier-limit", (*param("m = 9\n  tier 1 { m = 1 }"),), "limit moves <= m counts boat.moveTo"),
    Variant(
        "tier-alternative",
        (
            *param("odd = false\n  tier 1 { odd }"),
            (
                BOAT,
                (
                    "asset boat : lifeboat { position = (10 m, -1350 m), position = (10 m, -1450 m) when "
                    "odd, heading = 30 deg }"
                ),
            ),
        ),
    ),
    Variant(
        "tier-stage",
        (*param("strict = false\n  tier 1 { strict }"),),
        "stage s when strict { done when now > 100 s, ticks <= 50 }",
    ),
    Variant("switch-off", (*param("x = false"), *also("not x"))),
    Variant("require", (*param("n ~ integer(1, 3)"),), 'require n >= 1 because "x"'),
    Variant(
        "sites-along",
        (
            (
                VICTIM,
                "target victim : person_in_water { hidden position ~ sites_along([(0 m, -1000 m), (100 m, -1000 m)]) }",
            ),
        ),
    ),
    Variant(
        "radio-off-later",
        unlocked("exists q in order: true"),
        "message order : assignment from searcher to rescuer\n event e at 20 tick { comms { loss = 100 % } }",
    ),
    Variant(
        "radio-off-until",
        unlocked("exists q in order: true"),
        "message order : assignment from searcher to rescuer\n "
        "event e at 0 tick until now > 100 s { comms { loss = 100 % } }",
    ),
    Variant(
        "jam-corner",
        unlocked("exists q in order: true"),
        "message order : assignment from searcher to rescuer\n "
        "region all2 = box((-100 m, -1000 m), (300 m, -700 m))\n "
        "event e at 0 tick { jam all2 { loss = 100 % } }",
    ),
    Variant("vanish-late", (), "event e at 50 tick { vanish victim }"),
    Variant("vanish-until", (), "event e at 5 tick until now > 100 s { vanish victim }"),
    Variant(
        "status-reset-once",
        also("victim.status == adrift"),
        "event e when victim.status == rescued { change victim.status to adrift }",
    ),
    Variant(
        "event-2-times", unlocked("count(e) >= 2"), "event e at 100 s repeat every 60 s { weather { cloud = 20 % } }"
    ),
    Variant(
        "event-chain",
        unlocked("count(f) >= 1"),
        "event e at 100 s { weather { cloud = 20 % } }\n "
        "event f when held(count(e) >= 1, 60 s) { weather { cloud = 30 % } }",
    ),
    Variant("sent-late", unlocked("exists r: matched(v, r) and r.sent > 200 s")),
    Variant("role", unlocked("exists r: matched(v, r) and r.role == searcher")),
    Variant("battery", also("uav.battery < 99 %")),
    Variant("battery-window", also("uav.battery < 100 % and uav.battery > 20 %")),
    Variant("held", success("held(rescued(victim), 100 s)")),
    Variant("within", also("within(now > 100 s, rescued(victim), 400 s)")),
    Variant("before", also(f"before({SEEN}, rescued(victim))")),
    Variant(
        "serial",
        also("now > 500 s"),
        "stage a { done when now > 100 s }\n  stage b { done when rescued(victim), ticks <= 50 }\n  serial a, b",
    ),
    Variant("used", also("used(l) >= 1"), "limit l <= 3 counts boat.moveTo"),
    Variant("hard", (), "constraint hard c { always distance_xy(boat, victim) > 5 m or now > 10 s }"),
    Variant("hard-count", (), "constraint hard c { always count(rescue) < 2 }"),
    Variant("hard-held", (), "constraint hard c { always not held(now > 200 s, 390 s) }"),
    Variant("fail-late", (), "failure when now > 580 s and not rescued(victim)"),
    Variant("fail-move", (), "failure when boat.position.north > -500 m"),
    Variant("permit-photo", (), "permit uav.takePhoto when uav.position.elevation > 10 m"),
    Variant("deadline", (), "stage s { done when rescued(victim), deadline = 400 s }"),
    Variant("open-circle", (), "permit boat.moveTo when count(rescue) >= 1 or now > 60 s"),
)
