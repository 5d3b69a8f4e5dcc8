"""Search cells."""

import pytest
import shapely

from lingjing.mission import geometry2d
from lingjing.mission.grid import cells

FIELD = ((0.0, 0.0), (300.0, 0.0), (300.0, 200.0), (0.0, 200.0))
TRIANGLE = ((0.0, 0.0), (300.0, 0.0), (0.0, 300.0))


def test_rows_run_from_the_south_and_columns_from_the_west() -> None:
    made = {cell.name: cell for cell in cells("cells", FIELD, 2, 3, 0.0)}
    assert list(made) == [f"cells-{row}-{column}" for row in (1, 2) for column in (1, 2, 3)]
    assert made["cells-1-1"].centre == (50.0, 50.0)
    assert made["cells-2-3"].centre == (250.0, 150.0)
    assert (made["cells-2-3"].row, made["cells-2-3"].column) == (2, 3)


def test_neighbours_share_a_strip_of_the_overlap() -> None:
    made = {cell.name: cell for cell in cells("c", FIELD, 2, 3, 0.2)}
    shared = shapely.Polygon(made["c-1-1"].polygon).intersection(shapely.Polygon(made["c-1-2"].polygon))
    west, _, east, _ = shared.bounds
    assert east - west == pytest.approx(0.2 * 100)
    assert geometry2d.bounds(made["c-1-1"].polygon) == pytest.approx((0.0, 0.0, 110.0, 110.0))


@pytest.mark.parametrize("region", [FIELD, TRIANGLE])
def test_cells_cover_the_region_and_nothing_else(region: geometry2d.Polygon) -> None:
    made = cells("c", region, 3, 3, 0.1)
    union = shapely.union_all([shapely.Polygon(cell.polygon) for cell in made])
    assert union.symmetric_difference(shapely.Polygon(region)).area == pytest.approx(0, abs=1e-6)
    assert all(geometry2d.signed_area(cell.polygon) > 0 for cell in made)


def test_cells_outside_the_region_are_left_out_and_the_others_keep_their_names() -> None:
    names = [cell.name for cell in cells("c", TRIANGLE, 3, 3, 0.0)]
    assert names == ["c-1-1", "c-1-2", "c-1-3", "c-2-1", "c-2-2", "c-3-1"]
