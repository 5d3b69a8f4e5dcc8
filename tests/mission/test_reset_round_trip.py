"""A mission becomes a `resetScenario` document, a mission again, a text and a document again, without a loss.

Its events, stages, behaviours, deadlines and drawn params stay.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from lingjing.dsl.loading.load import templates_beside
from lingjing.dsl.printing.printer import round_trip_losses, to_ljs
from lingjing.mission.document import read
from lingjing.mission.instantiate import instantiate
from lingjing.mission.reset.emit import emit
from lingjing.testing import compile_file, compile_text
from tests.mission.language_cases import Variant
from tests.mission.over_time_cases import WINNABLE

SCENARIOS = Path(__file__).parents[2] / "scenarios"
FILES = sorted((*SCENARIOS.glob("*.ljs"), *SCENARIOS.glob("examples/*.ljs")))
REDRAWN = "castaways"
"""Its requirement discards draws. A document keeps the places and params, and draws the drift from the first stream."""


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_document_of_a_mission_gives_the_mission_and_the_document_again(file: Path) -> None:
    mission = compile_file(str(file)).mission
    assert mission is not None
    document = emit(mission, seed=3)
    again, _ = read(document, str(file.with_suffix(".json")), templates_beside(file.parent))
    first, second = instantiate(mission, seed=3), instantiate(again, seed=3)
    assert (first.events, first.stages, first.settings) == (second.events, second.stages, second.settings)
    assert [entity.position for entity in first.entities] == [entity.position for entity in second.entities]
    text = to_ljs(again)
    assert round_trip_losses(again, text) == ("$.origin.document",)
    if file.stem != REDRAWN:
        assert first.entities == second.entities
        printed = compile_text(text).mission
        assert printed is not None and emit(printed, seed=3) == document


@pytest.mark.parametrize("variant", WINNABLE, ids=lambda variant: variant.name)
def test_a_mission_with_events_and_drawn_params_is_written_as_text_without_a_loss(variant: Variant) -> None:
    mission = compile_text(variant.text).mission
    assert mission is not None and round_trip_losses(mission, to_ljs(mission)) == ()
