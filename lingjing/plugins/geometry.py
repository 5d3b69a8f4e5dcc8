"""Cameras and compass: pixel → ray → point on a horizontal plane, and back (`lingjing.scene.camera_geometry`).

The built-in camera engine draws with the same functions, so boxes and positions agree. Angles are degrees, headings
clockwise from north; lengths are metres.
"""

from lingjing.scene.camera_geometry import (
    MOUNTS,
    SPACE_M,
    bearing_deg,
    box_to_plane,
    camera_axes,
    camera_pose,
    distance_xy,
    focal_px,
    ground_footprint,
    heading_vector,
    in_image,
    mounted_camera_pose,
    offset_xy,
    pixel_ray,
    pixel_to_plane,
    pixel_to_world,
    turn_deg,
    world_to_pixel,
)

__all__ = [
    "MOUNTS", "SPACE_M", "bearing_deg", "box_to_plane", "camera_axes", "camera_pose", "distance_xy", "focal_px",
    "ground_footprint", "heading_vector", "in_image", "mounted_camera_pose", "offset_xy", "pixel_ray", "pixel_to_plane",
    "pixel_to_world", "turn_deg", "world_to_pixel",
]  # fmt: skip
