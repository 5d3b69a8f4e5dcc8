"""`Mission` → what a reader is told of it.

- `words`: conditions in plain words, and the bounds they set. `judging`: how each mission is judged, as a table.
- `page`: the documentation page of a mission.
"""
