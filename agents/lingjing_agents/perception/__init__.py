"""What pictures show: each module finds one kind of thing in the pixels of one picture.

- `images`             array types, OpenCV
- from above: `people_at_sea`, `fires_from_above`, `bridge_gaps`, `people_in_line`, `road_queues`, `pipe_leaks`
- from above, with depth: `depth_points` (what stands on the ground), `building_walls` (walls, their colours, doors)
- `learned`            a trained detector of people in the water and of fires ahead, from any height
- ahead, from a dog's eye: `fires_ahead`, `facades` (walls that look like a reference), `obstacles_ahead`

In: RGB (height, width, 3), depth where said, the camera's pose, the ground's elevation. Out: normalised boxes, places
in the world, confidences 0..1. Only colours and depths are looked at, never class masks. The thresholds were chosen on
rendered frames of other seeds than the studies use.
"""
