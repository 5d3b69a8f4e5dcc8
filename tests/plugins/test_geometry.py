"""Geometry: round trips, and comparisons with numbers computed by hand."""

from math import isclose, radians, tan

from hypothesis import assume, given
from hypothesis import strategies as st

from lingjing.mission.instance import CameraSpec
from lingjing.plugins import geometry
from lingjing.trace.records import BodyState, CameraPose

HALF = 100.0 * tan(radians(42.0))

poses = st.builds(
    CameraPose,
    position=st.tuples(st.floats(-2000, 2000), st.floats(-2000, 2000), st.floats(1, 200)),
    heading_deg=st.floats(0, 360),
    tilt_deg=st.floats(0, 90),
    roll_deg=st.floats(-40, 40),
    hfov_deg=st.floats(20, 120),
    width=st.just(1920),
    height=st.just(1080),
)


def camera(view: str) -> CameraSpec:
    return CameraSpec(
        name=view, view=view, width=1920, height=1080, hfov_deg=84.0, channels=("rgb",), capture="on_request"
    )


@given(poses, st.floats(0, 1920), st.floats(0, 1080), st.floats(0.5, 3000))
def test_a_pixel_is_the_same_after_projection_to_the_world_and_back(
    pose: CameraPose, u: float, v: float, depth: float
) -> None:
    pixel = geometry.world_to_pixel(pose, geometry.pixel_to_world(pose, u, v, depth))
    assert pixel is not None
    assert isclose(pixel[0], u, abs_tol=1e-4)
    assert isclose(pixel[1], v, abs_tol=1e-4)
    assert isclose(pixel[2], depth, rel_tol=1e-9)


@given(poses, st.floats(0, 1920), st.floats(0, 1080))
def test_the_point_of_a_pixel_lies_on_the_plane_and_projects_back(pose: CameraPose, u: float, v: float) -> None:
    point = geometry.pixel_to_plane(pose, u, v, -3.5)
    rise = geometry.pixel_ray(pose, u, v)[2]
    assert (point is None) == (rise >= 0.0)
    assume(point is not None and rise < -1e-3)
    assert point is not None and point[2] == -3.5
    back = geometry.world_to_pixel(pose, point)
    assert back is not None and isclose(back[0], u, abs_tol=1e-3) and isclose(back[1], v, abs_tol=1e-3)


@given(poses)
def test_camera_axes_are_orthonormal_and_right_handed(pose: CameraPose) -> None:
    right, down, forward = geometry.camera_axes(pose)
    for a, b, dot in ((right, right, 1), (down, down, 1), (right, down, 0), (right, forward, 0), (down, forward, 0)):
        assert isclose(sum(x * y for x, y in zip(a, b, strict=True)), dot, abs_tol=1e-12)
    assert isclose(right[0] * down[1] - right[1] * down[0], forward[2], abs_tol=1e-12)


def test_the_top_of_a_nadir_image_points_along_the_heading() -> None:
    body = BodyState(id="uav[1]", position=(10.0, 20.0, 100.1), heading_deg=90.0, pitch_deg=20.0, roll_deg=-15.0)
    pose = geometry.mounted_camera_pose(body, camera("nadir"), ())
    assert (pose.position, pose.tilt_deg) == ((10.0, 20.0, 100.0), 90.0)
    middle, top = geometry.pixel_to_plane(pose, 960, 540, 0.0), geometry.pixel_to_plane(pose, 960, 0, 0.0)
    right = geometry.pixel_to_plane(pose, 1920, 540, 0.0)
    assert middle is not None and top is not None and right is not None
    assert geometry.distance_xy(middle, (10.0, 20.0)) < 1e-9
    assert isclose(geometry.bearing_deg(middle, top), 90.0) and isclose(geometry.bearing_deg(middle, right), 180.0)
    assert isclose(right[1], 20.0 - HALF)


def test_the_front_camera_looks_along_the_heading_and_slightly_down() -> None:
    pose = geometry.camera_pose((0.0, 0.0, 50.05), 0.0, camera("front"))
    axis = geometry.camera_axes(pose)[2]
    assert isclose(pose.position[1], 0.30) and isclose(pose.position[2], 50.0)
    assert axis[1] > 0.98 and isclose(axis[2], -0.17364817766693033)
    point = geometry.pixel_to_plane(pose, 640.0 * 1.5, 540.0, 0.0)
    assert point is not None and isclose(point[1], 0.30 + 50.0 / tan(radians(10.0)))


def test_positive_roll_lowers_the_right_side() -> None:
    pose = CameraPose(position=(0, 0, 10), heading_deg=0.0, tilt_deg=0.0, roll_deg=10.0)
    right = geometry.camera_axes(pose)[0]
    assert right[0] > 0.9 and right[2] < 0.0


def test_bearings_turns_and_offsets_follow_the_compass() -> None:
    assert geometry.bearing_deg((12.4, -1351.8), (270.65, -921.5)) == geometry.bearing_deg((0, 0), (258.25, 430.3))
    assert round(geometry.bearing_deg((12.4, -1351.8), (270.65, -921.5))) == 31
    assert geometry.bearing_deg((0.0, 0.0), (-1e-18, 1.0)) == 0.0, "slightly west of north is 0 and not 360"
    assert geometry.turn_deg(350.0, 10.0) == 20.0 and geometry.turn_deg(10.0, 350.0) == -20.0
    east, north = geometry.offset_xy((1.0, 2.0), 270.0, 5.0)
    assert isclose(east, -4.0) and isclose(north, 2.0)


def test_points_behind_the_camera_and_pixels_above_the_horizon_are_not_projected() -> None:
    front = geometry.camera_pose((0.0, 0.0, 50.0), 0.0, camera("front"))
    assert geometry.world_to_pixel(front, (0.0, -10.0, 50.0)) is None
    assert geometry.pixel_to_plane(front, 960.0, 0.0, 0.0) is None
    assert geometry.ground_footprint(front, 0.0) is None
    down = geometry.camera_pose((0.0, 0.0, 100.1), 0.0, camera("nadir"))
    footprint = geometry.ground_footprint(down, 0.0)
    assert footprint is not None and isclose(footprint[0][0], -HALF) and isclose(footprint[2][1], -HALF * 9 / 16)
    spot = geometry.box_to_plane(down, (0.4, 0.4, 0.6, 0.6), 0.0)
    assert spot is not None and geometry.distance_xy(spot, (0.0, 0.0)) < 1e-9
