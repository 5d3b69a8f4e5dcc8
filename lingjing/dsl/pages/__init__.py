"""`Mission` → documentation for readers.

- `judging`: the adjudication of missions, as a table.
- `page`: the documentation page of a mission.
"""
