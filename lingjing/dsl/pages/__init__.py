"""`Mission` → what a reader is told of it.

- `judging`: how each mission is judged, as a table.
- `page`: the documentation page of a mission.
"""
