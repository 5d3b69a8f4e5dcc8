"""`docs/language.md`: every block of the language on it compiles, or has the error that it names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from lingjing.dsl.checking.library import known_paths, shipped_folder
from lingjing.mission.functions import DISTRIBUTIONS, FUNCTIONS
from lingjing.mission.units import NAMED, UNITS
from lingjing.testing import Compilation, compile_file, compile_text, instantiate

PAGE = (Path(__file__).parents[2] / "docs" / "language.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```ljs(?P<kind>[^\n]*)\n(?P<text>.*?)\n```$", re.MULTILINE | re.DOTALL)
BLOCKS = [(match["kind"].strip(), match["text"]) for match in BLOCK.finditer(PAGE)]
USES = """\
ljs 2
use std.air { quadrotor }
use std.ground { car }
use std.sea { lifeboat, person_in_water }
use std.messages { report, assignment, trafficJam }
use std.sensors { nadir_hd }
use std.traffic { destination }
use std.logistics { drop_point, cargo_quadrotor }
"""
# Beginning of a statement → the statement of the mission if an example does not have one.
REST = {
    "goal": 'goal "Go."',
    "scene": "scene coastal { extent = 3000 m }",
    "clock": "clock { tick = 10 s, sync = 500 ms }",
    "budget {": "budget { ticks <= 60 }",
    "mode": "mode broadcast in { star, broadcast }",
    "comms": "comms { hub = commander when mode == star }",
    "region search": "region search = box((-500 m, -500 m), (500 m, 500 m))",
    "grid cells": "grid cells over search { shape = 2 by 2 }",
    "target victim": "target victim : person_in_water { hidden position ~ sites(search) }",
    "asset uav": "asset uav[1..2] : quadrotor { position = (9 m * i, 0 m)\n camera nadir : nadir_hd }",
    "asset boat": "asset boat : lifeboat { position = (0 m, 0 m) }",
    "agent scout": "agent scout[i in 1..2] as searcher controls uav[i] { observes uav[i].* }",
    "agent skipper": "agent skipper as rescuer controls boat { observes boat.* }",
    "agent commander": "agent commander as coordinator when mode == star { observes events }",
    "message detection": "message detection : report from searcher to all",
    "adjudicate matched": (
        "adjudicate matched(v: victim, r: detection) { when iou(r.box, truth(v, r.frame).box) >= 0.5 }"
    ),
    "unlock rescue": "unlock rescue(v: victim) when exists r: matched(v, r)",
    "adjudicate rescued": "adjudicate rescued(v: victim) { when emitted(rescue, v) }",
    "stage detect": "stage detect per v in victim { done when exists r: matched(v, r) }",
    "stage execute": "stage execute per v in victim { done when rescued(v) }",
    "success": "success when forall v in victim: rescued(v)",
    "declassify end": 'declassify end because "it ends when all are rescued"',
}


def compiled(kind: str, text: str, folder: Path) -> Compilation:
    if kind.startswith("beside"):
        first = next(block for _, block in BLOCKS if block.startswith("ljs 2"))
        (folder / f"{kind.split()[1]}.ljs").write_text(first)
        (folder / "example.ljs").write_text(text)
        return compile_file(str(folder / "example.ljs"))
    if text.startswith("ljs 2"):
        return compile_text(text)
    statements = [re.sub(r"\s+", " ", line) for line in text.splitlines()]
    rest = [
        line
        for key, line in REST.items()
        if not any(re.match(rf"{re.escape(key)}\b|{re.escape(key)}", s) for s in statements)
    ]
    inside = "\n".join([*rest, text])
    return compile_text(f'{USES}mission example "Example" {{\n{inside}\n}}\n')


@pytest.mark.parametrize(("kind", "text"), BLOCKS, ids=lambda value: value.split("\n")[0][:40])
def test_a_block_of_the_page_compiles_or_has_the_error_that_it_names(kind: str, text: str, tmp_path: Path) -> None:
    compilation = compiled(kind, text, tmp_path)
    if kind.startswith("error"):
        assert {item.code for item in compilation.diagnostics} == {kind.split()[1]}
        return
    assert [(item.code, item.message) for item in compilation.diagnostics] == []
    if compilation.mission is not None:
        for mode in compilation.mission.modes.allowed:
            assert instantiate(compilation.mission, mode=mode).agents


@pytest.mark.parametrize("name", sorted({*FUNCTIONS, *DISTRIBUTIONS}))
def test_every_function_is_described(name: str) -> None:
    assert re.search(rf"[`(\s]{name}(\(|`)", PAGE), name


def test_every_unit_and_dimension_is_listed() -> None:
    words = set(re.split(r"[`\s,]+", PAGE))
    assert set(UNITS) <= words
    assert {entry.name for entry in NAMED} <= {word.rstrip(".:;") for word in words}


def test_every_library_and_what_it_declares_is_listed() -> None:
    for name in known_paths("std"):
        assert f"`{name}`" in PAGE
        text = (Path(shipped_folder("std")) / f"{name.removeprefix('std.')}.ljs").read_text(encoding="utf-8")
        for declared in re.findall(r"(?m)^(?:asset|target|camera|weather|record) (\w+)", text):
            assert re.search(rf"\b{declared}\b", PAGE), (name, declared)
