"""Coordinate frames: Unreal centimetres and WGS84, against formulas of another kind."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lingjing.mission import frames

ORIGIN = (31.0, 121.5)


def ecef(latitude: float, longitude: float) -> tuple[float, float, float]:
    """A point on the ellipsoid in earth-centred metres."""
    squared = frames.FLATTENING * (2 - frames.FLATTENING)
    phi, lam = math.radians(latitude), math.radians(longitude)
    radius = frames.EQUATOR_M / math.sqrt(1 - squared * math.sin(phi) ** 2)
    return (
        radius * math.cos(phi) * math.cos(lam),
        radius * math.cos(phi) * math.sin(lam),
        radius * (1 - squared) * math.sin(phi),
    )


def tangent_plane(latitude: float, longitude: float, origin: tuple[float, float]) -> tuple[float, float]:
    """East and north in the plane tangent at the origin."""
    dx, dy, dz = (a - b for a, b in zip(ecef(latitude, longitude), ecef(*origin), strict=True))
    phi, lam = math.radians(origin[0]), math.radians(origin[1])
    east = -math.sin(lam) * dx + math.cos(lam) * dy
    north = -math.sin(phi) * (math.cos(lam) * dx + math.sin(lam) * dy) + math.cos(phi) * dz
    return east, north


@given(st.floats(-0.03, 0.03), st.floats(-0.03, 0.03), st.sampled_from([ORIGIN, (60.17, 24.94), (-33.9, 18.4)]))
def test_projection_is_the_tangent_plane_to_a_few_millimetres(
    up: float, across: float, origin: tuple[float, float]
) -> None:
    place = origin[0] + up, origin[1] + across
    assert frames.from_geodetic(*place, origin) == pytest.approx(tangent_plane(*place, origin), abs=3e-3)


def test_projection_along_the_meridian_is_the_arc_of_the_ellipse() -> None:
    # Meridian arc by numerical integration, 30 deg to 32 deg.
    squared = frames.FLATTENING * (2 - frames.FLATTENING)
    steps = 2_000
    arc = sum(
        math.radians(2 / steps)
        * frames.EQUATOR_M
        * (1 - squared)
        / (1 - squared * math.sin(math.radians(30 + 2 * (k + 0.5) / steps)) ** 2) ** 1.5
        for k in range(steps)
    )
    assert frames.from_geodetic(32.0, 121.5, (30.0, 121.5)) == pytest.approx((0.0, arc), abs=1e-3)


@given(st.floats(-60, 60), st.floats(-179, 179), st.floats(-50_000, 50_000), st.floats(-50_000, 50_000))
def test_projection_round_trips(latitude: float, longitude: float, east: float, north: float) -> None:
    origin = latitude, longitude
    assert frames.from_geodetic(*frames.to_geodetic(east, north, origin), origin) == pytest.approx(
        (east, north), abs=1e-6
    )


def test_projection_works_across_the_date_line() -> None:
    east, north = frames.from_geodetic(10.0, -179.99, (10.0, 179.99))
    assert 2000 < east < 2300 and abs(north) < 1


def test_unreal_is_left_handed() -> None:
    assert frames.from_unreal(1240.0, 135180.0, -350.0) == (12.4, -1351.8, -3.5)
    assert math.copysign(1.0, frames.from_unreal(0.0, 0.0, 0.0)[1]) == 1.0


@given(*[st.integers(-(10**9), 10**9).map(lambda k: k / 1000)] * 3)
def test_unreal_and_back_is_exact(east: float, north: float, elevation: float) -> None:
    assert frames.from_unreal(*frames.to_unreal(east, north, elevation)) == (east, north, elevation)


@pytest.mark.parametrize(("yaw", "compass"), [(0.0, 90.0), (90.0, 180.0), (-90.0, 0.0), (270.0, 0.0), (-60.0, 30.0)])
def test_yaw_is_measured_from_east(yaw: float, compass: float) -> None:
    assert frames.compass_from_yaw(yaw) == pytest.approx(compass)
