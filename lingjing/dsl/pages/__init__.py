"""`Mission`, and the language itself → documentation for readers.

- `judging`: the adjudication of missions, as a table.
- `page`: the documentation page of a mission.
- `statements`: the reference page of the statements of the language.
"""
