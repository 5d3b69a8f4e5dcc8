"""The ground that pictures show: areas by hand, and the effect of altitude on coverage and localisation."""

from __future__ import annotations

import math

import pytest

import lingjing
from lingjing.mission.instantiate import instantiate
from lingjing.plugins.geometry import box_to_plane, focal_px
from lingjing.scene.ground_coverage import LEAST_DEPRESSION_DEG, add_ground, seen_ground, seen_share
from lingjing.testing import mission_file
from lingjing.trace.records import CameraPose

SQUARE = ((-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (-50.0, 50.0))


def pose(
    height_m: float, tilt_deg: float = 90.0, hfov_deg: float = 84.0, at: tuple[float, float] = (0.0, 0.0)
) -> CameraPose:
    return CameraPose(position=(*at, height_m), heading_deg=30.0, tilt_deg=tilt_deg, hfov_deg=hfov_deg)


@pytest.mark.parametrize("height_m", [60.0, 100.0, 140.0])
def test_a_picture_from_above_shows_a_rectangle(height_m: float) -> None:
    wide = 2.0 * height_m * math.tan(math.radians(42.0))
    assert seen_ground(pose(height_m), 0.0).area == pytest.approx(wide * wide * 1080 / 1920)
    assert seen_ground(pose(height_m), 20.0).area == pytest.approx(seen_ground(pose(height_m - 20.0), 0.0).area)


def test_a_tilted_picture_shows_a_trapezium() -> None:
    """45 degrees, 40 m up, 60 degrees wide: rays at 45 +- half of the vertical field of view, 48.6 to 116 m ahead."""
    half = math.atan(math.tan(math.radians(30.0)) * 1080 / 1920)
    near, far = (40.0 / math.tan(math.radians(45.0) + side * half) for side in (1.0, -1.0))
    lengths = [math.hypot(40.0, ahead) * math.cos(half) * math.tan(math.radians(30.0)) for ahead in (near, far)]
    assert seen_ground(pose(40.0, 45.0, 60.0), 0.0).area == pytest.approx((far - near) * sum(lengths), rel=1e-9)


@pytest.mark.parametrize("tilt_deg", [0.0, 10.0, 25.0])
def test_a_view_to_the_horizon_is_cut_off_at_the_least_depression(tilt_deg: float) -> None:
    shown = seen_ground(pose(50.0, tilt_deg), 0.0)
    reach = 50.0 / math.tan(math.radians(LEAST_DEPRESSION_DEG))
    assert 0.0 < shown.area < math.pi * reach**2
    assert max(math.hypot(*point) for point in shown.exterior.coords) == pytest.approx(reach, rel=1e-3)
    assert seen_ground(pose(50.0, -60.0), 0.0).is_empty  # it looks into the sky
    assert seen_ground(pose(-1.0), 0.0).is_empty


def test_ground_that_two_pictures_show_counts_once() -> None:
    once = seen_share([SQUARE], [pose(20.0)], 0.0)
    assert once == pytest.approx(seen_ground(pose(20.0), 0.0).area / 10_000.0)
    assert seen_share([SQUARE], [pose(20.0), pose(20.0)], 0.0) == pytest.approx(once)
    assert seen_share([SQUARE], [pose(200.0)], 0.0) == pytest.approx(1.0)
    assert seen_share([], [pose(20.0)], 0.0) is None


def test_shares_of_cells_add_up_picture_by_picture() -> None:
    cells = {"a": SQUARE, "b": tuple((x + 100.0, y) for x, y in SQUARE)}
    ground, shares = add_ground(cells, {}, [pose(20.0)], 0.0)
    assert shares["a"] == pytest.approx(seen_ground(pose(20.0), 0.0).area / 10_000.0) and shares["b"] == 0.0
    ground, shares = add_ground(cells, ground, [pose(20.0), pose(20.0, at=(100.0, 0.0))], 0.0)
    assert shares["a"] == pytest.approx(shares["b"])
    assert shares == {name: pytest.approx(share) for name, share in add_ground(cells, ground, [], 0.0)[1].items()}


def test_coverage_and_localisation_errors_rise_with_altitude_as_geometry_predicts() -> None:
    """The sea rescue, nine pictures from the middles of the cells. An error of two pixels is 2 h / f on the water."""
    ssr = instantiate(lingjing.compile(mission_file("ssr")), seed=0)
    level, cells = ssr.scene.datum_m, [cell.polygon for cell in ssr.cells]
    shares, errors = [], []
    for altitude in (60.0, 100.0, 140.0):
        shares.append(seen_share(cells, [pose(level + altitude, at=cell.centre) for cell in ssr.cells], level))
        above, moved = pose(level + altitude), (0.4 + 2 / 1920, 0.4, 0.41 + 2 / 1920, 0.41)
        here, there = box_to_plane(above, (0.4, 0.4, 0.41, 0.41), level), box_to_plane(above, moved, level)
        assert here is not None and there is not None
        errors.append(math.dist(here, there))
        assert errors[-1] == pytest.approx(2.0 * altitude / focal_px(above))
    assert shares == sorted(shares) and errors == sorted(errors)
    assert shares[0] is not None and shares[2] is not None and shares[2] > shares[0] + 0.3


def test_agents_receive_shares_only_at_tier_1_or_on_request() -> None:
    ssr = lingjing.compile(mission_file("ssr"))
    assert not any(cell.seen for cell in instantiate(ssr, seed=0).cells)
    assert all(cell.seen for cell in instantiate(ssr, seed=0, tier=1).cells)
    assert all(cell.seen for cell in instantiate(ssr, seed=0, settings={"shares": 1.0}).cells)
