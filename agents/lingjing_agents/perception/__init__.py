"""Detection of targets and obstacles in pictures: each module finds one kind of object in the pixels of one picture.

- `images`: array types and OpenCV
- from above: `people_at_sea`, `fires_from_above`, `bridge_gaps`, `people_in_line`, `road_queues`, `pipe_leaks`, and
  `road_blocks` (queues on both sides of a street)
- from above with depth: `depth_points` (obstacles on the ground), `building_walls` (walls with their colours and doors)
- `learned`: detectors that are trained on frames
- from a dog's height: `fires_ahead`, `facades` (walls similar to a reference), `obstacles_ahead`

In: RGB (height, width, 3), depth where declared, the camera's pose, the ground's elevation. Out: normalised boxes,
positions in the world, confidences from 0 to 1. Only colours and depths are used, never class masks. Thresholds without
another source were chosen on rendered frames of other seeds than the studies use.
"""
