"""Every diagnostic code has a failing example that pins its line and column."""

from __future__ import annotations

import pytest

from lingjing.dsl.diagnostics.codes import CODES
from lingjing.testing import compile_text
from lingjing.testing.missions import Diagnostic

HARD = "constraint hard dry { always now >= 0 s }"
RAFT = "target raft : person_in_water { interaction rescue { within = 1 m }, interaction rescue { within = 2 m } }"
HIT = "target wall { engine = city, interaction collided { by = vessel, within = 1 m } }"
GO = "asset tug : lifeboat { verb go(a: length, a: mass) }"

# code, replaced text of the small mission, its replacement, line, column, a part of the message
CASES = [
    ("LJ0001", "delay = 1 tick,", "delay = 1 tick;", 12, 60, "`;` has no meaning"),
    ("LJ0001", "Find everybody", "Find \u202e everybody", 7, 14, "U+202E"),
    ("LJ0002", '"Find everybody."', '"Find everybody.', 7, 8, "never closed"),
    ("LJ0003", "sites(search, apart >= 10 m)", "sites(search, apart >= 10 m", 19, 28, "`(` is never closed"),
    ("LJ0004", "apart >= 10 m)", "apart >= 10 m))", 19, 51, "`)` closes nothing"),
    ("LJ0005", "uavs = 2 in", "uavs = " + "(" * 65 + "2" + ")" * 65 + " in", 13, 79, "nested deeper"),
    ("LJ0006", "uavs = 2 in", "uavs = 2x3y in", 13, 16, "neither a number nor a name"),
    ("LJ0010", "tick = 10 s", "tick = = 10 s", 9, 18, "found `=`"),
    ("LJ0010", "to all\n", "too all\n", 31, 44, "`too` does not fit here"),
    ("LJ0011", "  goal ", "  gaol ", 7, 3, "no statement is called `gaol`"),
    ("LJ0012", "(12.4 m, -51.8 m)", "(12.4 m, north = -51.8 m)", 26, 47, "only a call"),
    ("LJ0013", "  param altitude", "  param \u0430ltitude", 14, 9, "`\u0430` (U+0430) is Cyrillic, not Latin"),
    ("LJ0013", "  param altitude", "  param \u0430\u0441\u0435 = 1\n  param ace", 14, 9, "looks like `ace`"),
    ("LJ0101", "distance_xy(boat, v)", "distance_xy(boot, v)", 34, 75, "nothing is called `boot`"),
    ("LJ0102", "r.frame", "r.fraem", 32, 76, "no field `fraem`"),
    ("LJ0103", "visibility = 8 km", "wind = 1 m/s from 2 deg", 11, 40, "`wind` is given twice"),
    ("LJ0104", "  param altitude", "  param uavs = 2\n  param altitude", 14, 9, "declared twice"),
    ("LJ0104", "  param altitude", "  param now = 2 s\n  param altitude", 14, 9, "`now` means the time"),
    ("LJ0104", "  success", f"  {HARD}\n  {HARD}\n  success", 39, 19, "the constraint `dry`"),
    ("LJ0104", "  success", f"  {HARD.replace('dry', 'rescued')}\n  success", 38, 19, "`rescued` is declared twice"),
    ("LJ0104", "mission small", f"{RAFT}\nmission small", 6, 82, "the interaction `rescue` is declared twice"),
    ("LJ0104", "mission small", f"{HIT}\nmission small", 6, 42, "`collided` is an event that engines report"),
    ("LJ0104", "mission small", f"{GO}\nmission small", 6, 43, "the argument `a`"),
    ("LJ0105", "exists r: matched(v, r) }", "exists q: rescued(v) }", 35, 51, "the domain of `q`"),
    ("LJ0106", "ticks <= 60, ", "", 10, 3, "lacks `ticks`"),
    ("LJ0107", "everybody.\"", "everybody.\"\n  done when true", 8, 3, "`done` has no meaning in a mission"),
    ("LJ0108", "visibility = 8 km", "visibilty = 8 km", 11, 40, "knows no `visibilty`"),
    ("LJ0109", "channels = [rgb]", "channels = [rbg]", 23, 66, "cannot be `rbg`"),
    ("LJ0110", "{ done when rescued(v) }", "{ when rescued(v) }", 36, 35, "needs `done when …`"),
    ("LJ0111", "victim[1..3]", "victim[3]", 18, 17, "counted `1..n`"),
    ("LJ0112", ": lifeboat {", ": person_in_water {", 26, 16, "is a target type"),
    ("LJ0113", "takePhoto }", "takePicture }", 24, 41, "has no verb `takePicture`"),
    ("LJ0114", "may command boat", "may command victim", 30, 34, "agents cannot command it"),
    ("LJ0115", "as coordinator when", "as coordinator controls boat when", 29, 43, "controlled by two agents"),
    ("LJ0116", "observes cells }", "observes search }", 29, 63, "cannot be observed"),
    ("LJ0117", "ljs 2", "ljs 9", 1, 5, "version 9"),
    ("LJ0118", "use std.sea", "use std.see", 3, 5, "no library `std.see`"),
    ("LJ0121", "Find everybody.", "Find {uav[}.", 7, 14, "is no name"),
    ("LJ0122", "{ datum = sea", '{ map = "../a.osm", datum = sea', 8, 21, "leads out of the project"),
    ("LJ0123", "  param altitude", "  override param altitude", 14, 3, "nothing to override"),
    ("LJ0127", '"Find everybody."', '"Find everybody."\n  goal zh "Find {uavs}."', 8, 11, "has `{uavs}` besides"),
    ("LJ0127", '"Find everybody."', '"Find {uavs}."\n  goal zh "Find them."', 8, 11, "lacks `{uavs}`"),
    ("LJ0127", '"Find everybody."', '"Find everybody."\n  goal chinese "Find."', 8, 8, "no code of another language"),
    ("LJ0127", '"Find everybody."', '"Find everybody."\n  goal zh " "', 8, 11, "the goal in `zh` is empty"),
    ("LJ0127", '"Find everybody."', '"Find everybody."\n  goal en "Find."', 8, 8, "`en` is no code of another"),
    ("LJ0127", "observes boat.*,", 'prompt "Go."\n    prompt zh "Go."\n    observes boat.*,', 29, 12, "no text in"),
    ("LJ0201", "heading = 30 deg", "heading = boat", 26, 67, "an angle is due"),
    ("LJ0201", "(v: victim) when exists", "(u: uav) when exists v in victim: exists", 33, 20, "is no interaction of"),
    ("LJ0202", "tick = 10 s", "tick = 10", 9, 18, "a duration is due"),
    ("LJ0203", "tick = 10 s", "tick = 10 m", 9, 18, "this is a length"),
    ("LJ0203", "forall v in victim: rescued(v)", "now >= 3 tick", 38, 16, "a duration with a count of ticks"),
    ("LJ0204", "tick = 10 s", "tick = 10 sec", 9, 21, "no unit is called `sec`"),
    ("LJ0205", "shape = 3 by 3", "shape = 9", 17, 36, "two numbers"),
    ("LJ0206", "uavs = 2 in", "uavs = 20 in", 13, 16, "outside of its bounds"),
    ("LJ0206", "visibility = 8 km", "current = 90 m/s to 3 deg", 11, 50, "`current` must be at least 0 and at most 15"),
    ("LJ0206", "visibility = 8 km", "wave_height ~ uniform(1 m, 50 m)", 11, 54, "this draw can give 50"),
    ("LJ0207", "uavs = 2 in", "uavs = 2 / 0 in", 13, 20, "division by zero"),
    ("LJ0208", "(100 m, 0 m), (100 m, 100 m)", "(100 m, 100 m), (100 m, 0 m)", 16, 19, "the outline"),
    ("LJ0209", "tick = 10 s", "tick = 1e308 s", 9, 18, "`1e308 s` is too large"),
    ("LJ0209", "uavs = 2 in", "uavs = 1e9 * 1e9 in", 13, 16, "`1e9 * 1e9` is too large"),
    ("LJ0209", "(100 m, 100 m)", "(100 m, 1e308 m)", 16, 61, "`1e308 m` is too large"),
    ("LJ0209", "[1..3]", "[1..1e9*1e9]", 18, 20, "`1e9*1e9` is too large"),
    ("LJ0211", "(12.4 m, -51.8 m)", "(12.4 m, -51.8 m, -2431 m)", 26, 38, "(12.4 m, -51.8 m, -2431 m) is no place"),
    ("LJ0211", "(12.4 m, -51.8 m)", "(12.4 m, -51.8 m, 990 km)", 26, 38, "between -500 m and 30,000 m"),
    ("LJ0211", "(12.4 m, -51.8 m)", "(1240 km, -51.8 m)", 26, 38, "is beyond every scene"),
    ("LJ0211", "(1 m, 2 m)", "(5000 m, 20 m, 1 m)", 21, 9, "outside of the scene, which spans 3,000 m to every side"),
    ("LJ0211", "(1 m, 2 m)", "(1 m, 2 m, -30 m)", 21, 9, "below everything in the scene"),
    ("LJ0211", "(12.4 m, -51.8 m)", "(12.4 m, -51.8 m, 46 m)", 26, 9, "is always on the water, which lies at -3.5 m"),
    ("LJ0211", "(12.4 m, -51.8 m)", "(300 m, -620 m)", 26, 9, "begins at (300 m, -620 m, -3.5 m), which is on land"),
    ("LJ0212", "(1 m, 2 m), (3 m, 4 m)", "(1 m, 2 m), (1 m, 2.5 m)", 21, 9, "where `uav[1]` is: they would overlap"),
    ("LJ0301", "~ sites(search, apart >= 10 m)", "~ (1 m, 2 m)", 19, 23, "a distribution is due"),
    ("LJ0302", "visibility = 8 km", "visibility = uniform(1 km, 2 km)", 11, 53, "draws a value"),
    ("LJ0303", "ticks <= 60", "ticks = 60", 10, 12, "takes `<=`, not `=`"),
    ("LJ0304", "uavs = 2 in", "uavs = iou(1, 2) in", 13, 16, "while the mission runs"),
    ("LJ0306", "distance_xy(boat, v)", "distance_xy(boat)", 34, 63, "takes 2 arguments, 1 given"),
    ("LJ0307", "when mode == star, delay", "when mode == broadcast, delay", 12, 32, "a hub exists in star mode"),
    ("LJ0308", "{ when emitted(rescue, v) and", "{ when rescued(v) and", 34, 14, "refers to itself"),
    ("LJ0401", "observes cells }", "observes victim[1].position }", 29, 63, "a hidden value reaches"),
    ("LJ0402", "tick = 10 s", "hidden tick = 10 s", 9, 11, "cannot be hidden"),
    ("LJ0403", "observes cells }", "observes cells, uav.position }", 29, 70, "receives no picture of its cameras"),
    ("LJ0403", "observes uav[i].*, ", "observes uav[i].position, ", 27, 68, "`scout` observes fields of `uav[i]`"),
    ("LJ0404", "\n  declassify end", "\n  # declassify end", 38, 3, "depends on `victim`, which hides its `position`"),
    ("LJ0404", "  success", "  permit boat.moveTo when exists r: matched(victim[1], r)\n  success", 38, 10,
     "receipts show whether `boat.moveTo` is permitted, which depends on `victim`, which hides"),
    ("LJ0404", "  success", "  constraint hard far { always distance_xy(boat, victim[1]) >= 1 m }\n  success", 38, 19,
     "the episode ends when `far` is broken, which depends on `victim`"),
    ("LJ0404", "{ done when rescued(v) }", "{ done when rescued(v), ticks <= 40 }", 36, 9, "stage `execute` is late"),
    ("LJ0406", "  success", '  declassify boat.stop because "x"\n  success', 38, 14, "there is nothing to declassify"),
    ("LJ0501", "sync = 500 ms", "sync = 3 s", 9, 31, "no whole multiple"),
    ("LJ0501", "sync = 500 ms", "sync = 1e-9 ms", 9, 31, "at most 100,000 are possible"),
    ("LJ0503", "  success", "  sweep s over uavs in 1..10000000\n  success", 38, 24, "10,000,000 values"),
    ("LJ0504", "mode broadcast in { star, broadcast }", "mode single in { single, star }", 15, 18, "excludes other"),
    ("LJ0507", "lifeboat {", "lifeboat when mode == star {", 27, 9, "in broadcast mode, there is no"),
    ("LJ0508", "bay { datum = sea level at -3.5 m }", "coastal { datum = sea level at 0 m }", 8, 19, "flood"),
    ("LJ0510", "forall v in victim: rescued(v)", "now >= 0 s", 38, 3, "holds at the start, before any agent acts"),
    ("LJ0511", "  success", "  failure when now < 9 s\n  success", 38, 3, "failure holds at the start"),
    ("LJ0511", "  success", f"  {HARD.replace('>= 0', '> 0')}\n  success", 38, 19, "`dry` does not hold at the start"),
    ("LJ0512", "  success", "  event late at 61 tick { vanish victim[1] }\n  success", 38, 17, "the last of 60 ticks"),
    ("LJ0512", "  success", "  event late at 11 min { vanish victim[1] }\n  success", 38, 17, "the last of 60 ticks"),
    ("LJ0512", "  success", "  event still at 9 s { weather { } }\n  success", 38, 24, "`weather` changes nothing"),
    ("LJ0512", "  success", f"  {HARD.replace('hard', 'soft')}\n  success", 38, 19, "breaking it costs nothing"),
    ("LJ0502", "hub = commander when mode == star, ", "", 15, 3, "star mode has no hub"),
]  # fmt: skip
ELSEWHERE = {"LJ0405", "LJ0007", "LJ0008", "LJ0009", "LJ0119", "LJ0120", "LJ0124", "LJ0505", "LJ0506", "LJ0509"} | {
    code for code in CODES if code.startswith("LJ06") or code in ("LJ0125", "LJ0126", "LJ0210")
}
"""Codes with examples in separate files; tested below, in `test_infeasibility`, `test_inputs`,
`test_providers`, `test_playability`, `test_interactions`, `test_library`, `test_inherit` and `test_wide`."""


def test_the_small_mission_is_good(small: str) -> None:
    assert compile_text(small).diagnostics == ()


@pytest.mark.parametrize(("code", "old", "new", "line", "column", "part"), CASES, ids=lambda value: str(value)[:24])
def test_a_faulty_text_gives_its_code_line_and_column(
    small: str, code: str, old: str, new: str, line: int, column: int, part: str
) -> None:
    assert small.count(old) >= 1
    diagnostics = compile_text(small.replace(old, new, 1)).diagnostics
    assert shown(diagnostics) == [(code, line, column)]
    assert part in diagnostics[0].message
    assert diagnostics[0].span.end >= diagnostics[0].span.start


def test_every_code_has_an_example() -> None:
    assert {case[0] for case in CASES} | ELSEWHERE == set(CODES)


def test_an_empty_file_gives_one_error() -> None:
    assert shown(compile_text(" \n\t\n").diagnostics) == [("LJ0007", 1, 1)]


def test_the_number_of_diagnostics_is_bounded() -> None:
    diagnostics = compile_text("ljs 1\n" + "$\n" * 5000).diagnostics
    assert len(diagnostics) == 1000
    assert "LJ0008" in {item.code for item in diagnostics}


def shown(diagnostics: tuple[Diagnostic, ...]) -> list[tuple[str, int, int]]:
    return [(item.code, item.span.line, item.span.column) for item in diagnostics]


@pytest.mark.parametrize("name", ["α_max", "Δt", "海_east", "скорость", "ταχύτητα", "café", "ace_\u03bd"])
def test_names_in_other_scripts_are_permitted(small: str, name: str) -> None:
    assert compile_text(small.replace("  param altitude", f"  param {name} = 1\n  param altitude")).diagnostics == ()


def test_a_look_alike_letter_gives_one_warning_with_the_latin_name_as_its_fix(small: str) -> None:
    twice = small.replace("param altitude", "param he\u0456ght = 2 m\n  param altitude").replace(
        "speed <= 3 m/s", "speed <= he\u0456ght / 1 s"
    )
    compilation = compile_text(twice)
    (diagnostic,) = compilation.diagnostics
    assert compilation.mission is not None and diagnostic.severity == "warning" and diagnostic.fix is not None
    assert [edit.text for edit in diagnostic.fix.edits] == ["height", "height"] and not diagnostic.fix.safe


def test_a_single_mode_without_an_agent_is_an_error() -> None:
    diagnostics = compile_text('ljs 1\nmission m "" {\n  mode single\n}\n').diagnostics
    assert {item.code for item in diagnostics} == {"LJ0106"} and "the mission has no agent" in [
        i.message for i in diagnostics
    ]
