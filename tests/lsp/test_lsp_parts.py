"""The language server's functions, called directly. A bar `|` in a text marks the cursor."""

from __future__ import annotations

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lingjing.dsl.syntax.statements import KINDS
from lingjing.dsl.syntax.tokens import STATEMENTS
from lingjing.errors import UsageError
from lingjing.lsp.analysis import Analysis
from lingjing.lsp.complete import complete
from lingjing.lsp.explain import KEYWORDS, explain
from lingjing.lsp.outline import outline
from lingjing.lsp.positions import Positions, TextPosition
from lingjing.lsp.rename import applied, rename
from lingjing.testing import compile_text, mission_file
from lingjing.testing.missions import SourceText

SSR = mission_file("ssr").read_text(encoding="utf-8")


def labels(text: str) -> list[str]:
    offset = text.index("|")
    return [item.label for item in complete(Analysis(text.replace("|", ""), "<test>"), offset).items]


def within(line: str, *, at: str = "  success") -> str:
    """The shipped mission with a line inserted before another."""
    return SSR.replace(at, f"  {line}\n{at}", 1)


@pytest.mark.parametrize(
    ("line", "offered", "not_offered"),
    [
        ("|", {"region", "stage", "success", "param"}, {"record", "engine", "rgb"}),
        ("clock { tick = 3 | }", {"s", "ms", "min", "h"}, {"m", "kg", "deg"}),
        ("clock { | }", {"tick", "sync"}, {"region", "wind"}),
        ("weather { wind = 4 | }", {"m/s", "km/h", "kn"}, {"s", "m"}),
        ("weather { wind = 4 m/s from 20 | }", {"deg", "rad"}, {"m/s", "m"}),
        ("weather { visibility = 8 k| }", {"km", "m"}, {"kg"}),
        ("param height = 3 m in 1 m..9 |", {"m", "km"}, {"s"}),
        ("asset x : |", {"quadrotor", "lifeboat"}, {"person_in_water", "report"}),
        ("target x : |", {"person_in_water"}, {"lifeboat"}),
        ("asset x : quadrotor { | }", {"band", "cruise", "camera", "actions", "position"}, {"region", "drift"}),
        ("asset x : quadrotor { actions { | } }", {"forward", "takePhoto"}, {"moveTo", "camera"}),
        ("asset x : quadrotor { actions { takeoff, | } }", {"forward"}, {"band"}),
        ("asset x : quadrotor { actions { forward <= 5 | } }", {"m"}, {"s"}),
        ("target x : person_in_water { position ~ | }", {"sites", "uniform"}, {"distance", "position"}),
        ("target x : person_in_water { position ~ sites(search, apart >= 8 |) }", {"m"}, {"s"}),
        ("target x : person_in_water { position ~ sites(|) }", {"search"}, {"iou"}),
        ("asset x : quadrotor { camera low { | } }", {"view", "size", "channels"}, {"band", "region"}),
        ("asset x : quadrotor { camera low { capture = | } }", {"on_request", "each_tick"}, {"rgb"}),
        ("asset x : quadrotor { camera low { channels = [|] } }", {"rgb", "depth"}, {"on_request"}),
        ("target x : person_in_water { | }", {"behaviour", "hidden"}, {"interaction"}),
        ("target x : person_in_water { behaviour | }", {"flee", "wander", "follow"}, {"boat"}),
        ("target x : person_in_water { behaviour flee { | } }", {"from", "speed", "within"}, {"tick"}),
        ("message x : |", {"report", "status"}, {"quadrotor"}),
        ("message x : report from |", {"searcher", "rescuer"}, {"boat", "all"}),
        ("message x : report from searcher to |", {"searcher", "all"}, {"boat"}),
        ("authority searcher may command |", {"boat", "uav"}, {"victim", "searcher"}),
        ("agent x as |", {"searcher"}, {"boat"}),
        ("agent x as y controls |", {"boat"}, {"victim"}),
        ("agent x as y { observes uav[1].| }", {"position", "band"}, {"x"}),
        ("agent x as y { observes peers.| }", {"position", "busy"}, {"band"}),
        ("relation |", {"guidance", "dependency"}, {"searcher"}),
        ("relation dependency |", {"locate", "detect"}, {"searcher"}),
        ("relation guidance searcher -> |", {"rescuer"}, {"locate"}),
        ("relation guidance searcher -> rescuer by |", {"detection"}, {"boat"}),
        ("grid g over |", {"search"}, {"boat"}),
        ("unlock |", {"rescue"}, {"matched"}),
        ("stage s per v in |", {"victim", "uav"}, {"search"}),
        ("stage s per v in victim { | }", {"done"}, {"region"}),
        ("adjudicate x(v: |) { when true }", {"victim", "detection"}, {"search"}),
        ("adjudicate x(v: victim, r: detection) { when | }", {"v", "r", "matched", "iou", "exists"}, {"polygon"}),
        ("adjudicate x(v: victim, r: detection) { when r.| }", {"class", "confidence"}, {"drift"}),
        ("adjudicate x(v: victim, r: detection) { when v.| }", {"drift", "position"}, {"class"}),
        ("adjudicate x(v: victim, r: detection) { when truth(v, r.frame).| }", {"box"}, {"class"}),
        ("adjudicate x(v: victim) { when exists q: matched(v, q) and q.| }", {"class"}, {"drift"}),
        ("adjudicate x(v: victim) { when boat.position.| }", {"x", "y"}, {"heading"}),
        ("adjudicate x(v: victim) { when distance_xy(boat, v) <= 5 | }", {"m", "km"}, {"s"}),
        ("scene residential { | }", {"datum", "origin", "extent"}, {"tick", "distractors"}),
        ("inspection x of boat by uav[1] { | }", {"within"}, {"tick"}),
        ("mode |", {"star", "broadcast"}, {"boat"}),
        ("# a comment |", set(), {"region"}),
        ('goal "find |"', set(), {"uavs"}),
        ('goal "find {|}"', {"uavs", "victims"}, {"region"}),
    ],
)  # fmt: skip
def test_completion_offers_words_that_fit_the_place(line: str, offered: set[str], not_offered: set[str]) -> None:
    proposed = set(labels(within(line)))
    assert offered <= proposed, sorted(proposed)
    assert not (not_offered & proposed)


def test_completion_offers_libraries_and_their_declarations() -> None:
    assert {"std.air", "std.sea", "scenarios.ssr"} <= set(labels("ljs 1\nuse |"))
    assert {"bi", "ssr"} <= set(labels("ljs 1\nuse scenarios.|"))
    assert labels("ljs 1\nuse scenarios.ssr { | }") == ["ssr"]
    assert {"air", "sea"} <= set(labels("ljs 1\nuse std.|"))
    assert set(labels("ljs 1\nuse std.sea { | }")) >= {"lifeboat", "person_in_water"}


@pytest.mark.parametrize("step", [149, pytest.param(37, marks=pytest.mark.thorough)])
def test_completion_raises_no_error_at_places_of_whole_and_cut_texts(step: int) -> None:
    """At places in equal steps, and behind the first of each mark."""
    whole = Analysis(SSR, "<test>")
    for end in {*range(0, len(SSR), step), *(SSR.index(mark) + 1 for mark in '.:=<[({,"~')}:
        complete(Analysis(SSR[:end], "<test>"), end)
        complete(whole, end)


def hovered(word: str, *, nth: int = 0, text: str = SSR) -> str:
    offset = -1
    for _ in range(nth + 1):
        offset = text.index(word, offset + 1)
    explained = explain(Analysis(text, "<test>"), offset)
    assert explained is not None, word
    return explained[0]


@pytest.mark.parametrize(
    ("word", "expected"),
    [
        ("altitude", "param, a length in `m`"),
        ("search =", "region"),
        ("quadrotor", "An asset type of the engine `multirotor`."),
        ("report", "message record (report)"),
        ("detection", "message kind"),
        ("100 m", "length: `100 m`"),
        ("8 km", "length: `8000 m`"),
        ("20 %", "number: `0.2`"),
        ("iou", "intersection over union"),
        ("sites", "a place in the region"),
        ("adjudicate", "an event, once it is true"),
        ("searcher", "role"),
        ("takeoff", "verb of `quadrotor`: climbs"),
        ("band", "range of lengths"),
    ],
)
def test_hover_explains_a_word_of_a_mission(word: str, expected: str) -> None:
    assert expected in hovered(word)


def test_hover_describes_the_property_of_the_enclosing_type() -> None:
    """The van and the dog each have a `speed`."""
    text = mission_file("ld").read_text(encoding="utf-8")
    head = "asset dog : robot_dog {"
    assert "of `robot_dog`" in hovered("speed = 1.5", text=text.replace(head, f"{head}\n    speed = 1.5 m/s"))


def test_completion_describes_names_in_the_words_of_the_language() -> None:
    text = "ljs 1\nasset mule : quadruped { engine = x }\n" + SSR.removeprefix("ljs 1\n")
    offset = text.index("success when") + len("success when ")
    items = complete(Analysis(text, "<test>"), offset).items
    details = {item.detail for item in items if item.kind in ("name", "type")}
    assert not any(detail.endswith(("Block", "Line")) for detail in details), details
    assert [item.detail for item in items if item.label == "searcher"] == ["role"]
    named = [(item.label, item.kind) for item in items if item.kind in ("name", "type")]  # a buoy is a group and a type
    assert len(named) == len(set(named))


def test_hover_shows_the_comment_above() -> None:
    text = SSR.replace("  param altitude", "  # How high they search.\n  # Above the sea.\n  param altitude")
    assert "How high they search.\nAbove the sea." in hovered("altitude", text=text)
    assert "Vessels" not in hovered("lifeboat")


def test_definitions_are_found_in_the_file_and_in_the_library() -> None:
    analysis = Analysis(SSR, "<test>")

    def declared(word: str) -> tuple[str, int, int]:
        occurrence = analysis.names.at(SSR.index(word))
        assert occurrence is not None
        place = analysis.declaration(occurrence)
        assert place is not None
        return place

    def in_library(name: str, place: str, kind: str) -> tuple[str, int, int]:
        path = mission_file(f"std/{name}")
        start = path.read_text(encoding="utf-8").index(f"{kind} {place}") + len(kind) + 1
        return str(path), start, start + len(place)

    assert declared("lifeboat, person") == in_library("sea.ljs", "lifeboat", "asset"), "in a `use`"
    assert declared("lifeboat {") == in_library("sea.ljs", "lifeboat", "asset"), "as the type of an asset"
    start = SSR.index("cells over")
    assert declared("cells, peers") == ("<test>", start, start + len("cells"))
    assert declared("takePhoto") == in_library("air.ljs", "takePhoto", "verb")
    assert declared("rescue(v") == in_library("sea.ljs", "rescue", "interaction")


def test_references_distinguish_local_names() -> None:
    analysis = Analysis(SSR, "<test>")
    occurrence = analysis.names.at(SSR.index("v: victim, r: detection) {\n    when matched"))
    assert occurrence is not None
    places = [SSR[place.start : place.end] for place in analysis.names.of(occurrence.key)]
    assert places == ["v", "v"]


@pytest.mark.parametrize(
    ("word", "new"), [("uavs", "n"), ("victim[", "person"), ("searcher", "finder"), ("boat :", "ship"),
                      ("detection", "sighting"), ("matched", "hit"), ("locate ", "pin"), ("search =", "area")]
)  # fmt: skip
def test_renaming_a_name_and_back_restores_the_text(word: str, new: str) -> None:
    analysis = Analysis(SSR, "<test>")
    offset = SSR.index(word)
    old = word.strip(" [:=")
    text = applied(SSR, rename(analysis, offset, new), new)
    mission = compile_text(text)
    assert mission.diagnostics == ()
    again = Analysis(text, "<test>")
    back = applied(text, rename(again, text.index(new, offset), old), old)
    assert back == SSR


@pytest.mark.parametrize(
    ("word", "new", "why"),
    [
        ("uavs", "victims", "already declared in line"),
        ("uavs", "2nd", "is no name"),
        ("uavs", "two words", "is no name"),
        ("uavs", "region", "a word of the language"),
        ("uavs", "iou", "built in"),
        ("quadrotor", "drone", "not declared in this file"),
        ("takeoff", "lift", "not declared in this file"),
        ("matched", "cells", "already declared"),
        ("v: victim, r: detection)", "r", "already declared"),
        ("victim[", "v", "already declared"),
        ("goal", "aim", "no name here"),
    ],
)
def test_renaming_is_refused_with_a_reason(word: str, new: str, why: str) -> None:
    with pytest.raises(UsageError, match=why):
        rename(Analysis(SSR, "<test>"), SSR.index(word), new)


def test_renaming_reaches_holes_in_texts() -> None:
    text = SSR.replace("Find every person", "Find all {victims} people")
    places = rename(Analysis(text, "<test>"), text.index("victims} people"), "lost")
    assert "Find all {lost} people" in applied(text, places, "lost")


def test_outline_is_nested() -> None:
    (mission,) = [entry for entry in outline(Analysis(SSR, "<test>").tree) if entry.keyword == "mission"]
    assert (mission.name, mission.detail) == ("ssr", "Sea search and rescue")
    uav = next(entry for entry in mission.children if entry.name == "uav")
    assert [child.name for child in uav.children] == ["nadir", "front"]


@given(st.text(max_size=60), st.sampled_from(["utf-16", "utf-8", "utf-32"]))
def test_an_offset_converted_to_a_position_and_back_is_unchanged(text: str, encoding: str) -> None:
    source = SourceText(text)
    positions = Positions(source, encoding)
    for offset in range(len(source.text) + 1):
        before = source.text[offset - 1 : offset]
        if before == "\r" and source.text[offset : offset + 1] == "\n":
            continue
        assert positions.offset(positions.place(offset)) == offset


def test_columns_count_code_units() -> None:
    positions = Positions(SourceText("a😀灵b\nc"))
    assert positions.place(3) == TextPosition(0, 4)
    assert positions.offset(TextPosition(0, 2)) == 1
    assert positions.offset(TextPosition(0, 99)) == 4
    assert positions.offset(TextPosition(9, 0)) == 6


def test_every_keyword_is_explained_and_offered_somewhere() -> None:
    assert set(STATEMENTS) <= set(KEYWORDS)
    blocks = {
        "file": "|", "mission": "mission m { | }", "type": "asset t { | }", "asset": "mission m { asset a : t { | } }",
        "target": "mission m { target a : t { | } }", "agent": "mission m { agent a as b { | } }",
        "adjudicate": "mission m { adjudicate a(v: b) { | } }", "stage": "mission m { stage a { | } }",
        "constraint": "mission m { constraint hard a { | } }", "event": "mission m { event a at 1 tick { | } }",
        "expect": "mission m { expect { | } }",
    }  # fmt: skip
    for word, kind in KINDS.items():
        for place in kind.within:
            block = blocks[place].replace("|", "oracle |") if kind.has_subject else blocks[place]
            assert word in labels(block), (word, place)


@pytest.mark.parametrize(
    ("line", "offered", "not_offered"),
    [
        ("constraint |", {"hard", "soft"}, {"boat"}),
        ("constraint hard x per u in |", {"uav", "victim"}, {"search"}),
        ("constraint hard x |", {"per", "when"}, {"and"}),
        ("inspection x |", {"of"}, {"by", "boat"}),
        ("inspection x of boat |", {"by", "and"}, {"of"}),
        ("reveal |", {"image"}, {"boat"}),
        ("reveal image(victim[1]) |", {"to"}, {"from"}),
        ("reveal image(victim[1]) to |", {"searcher"}, {"boat"}),
        ("relation cooperation searcher <->|", {"rescuer"}, {"locate"}),
        ("relation guidance searcher -> rescuer |", {"by", "carries", "when"}, {"and"}),
        ("message x : report |", {"from"}, {"to", "and"}),
        ("message x : report from searcher, |", {"rescuer"}, {"all"}),
        ("message x : report from searcher |", {"to"}, {"from"}),
        ("agent x[i in 1..2] |", {"as"}, {"controls", "and"}),
        ("agent x as y |", {"controls", "when"}, {"as"}),
        ("mode broadcast in { |", {"star"}, {"boat"}),
        ("mission x |", {"extends"}, {"from"}),
    ],
)
def test_completion_follows_the_pattern_of_the_statement(line: str, offered: set[str], not_offered: set[str]) -> None:
    proposed = set(labels(within(line)))
    assert offered <= proposed, sorted(proposed)
    assert not (not_offered & proposed)


def test_hover_over_a_type_shows_its_interactions_and_words() -> None:
    markdown = explain(Analysis(SSR, "<test>"), SSR.index("person_in_water") + 3)
    assert markdown is not None
    assert "interaction `rescue`: by `vessel`, within 50 m" in markdown[0]
    assert "`adrift`, `dormant`, `rescued`" in markdown[0]


def test_a_faulty_edit_of_a_thousand_lines_is_answered_in_300_ms_of_cpu() -> None:
    targets = "".join(
        f"  target t{n} : person_in_water {{\n    position = ({n}.5 m, -{n}.25 m)\n    drift = 0.5 m/s\n  }}\n"
        for n in range(250)
    )
    text = SSR.replace("  asset boat", f"{targets}  asset boat", 1).replace("drift = 0.5 m/s", "drift = 0.5 kg", 1)
    assert text.count("\n") > 1000
    spent = []
    for edit in range(5):
        analysis = Analysis(text + " " * edit, "<long>")
        began = time.process_time()
        assert [item.code for item in analysis.diagnostics] == ["LJ0203"]
        assert analysis.names.declared and analysis.scope.groups
        spent.append(time.process_time() - began)
    assert min(spent) <= 0.3
