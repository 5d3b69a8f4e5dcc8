"""`Mission`, and the language itself → documentation for readers.

- `judging`: the adjudication of missions, as a table.
- `page`: the documentation page of a mission.
- `library`: the page of a library file. `card`: the language on one card.
- `statements`: the reference page of the statements of the language.
- `gbnf`: the grammar for services with constrained decoding.
"""
