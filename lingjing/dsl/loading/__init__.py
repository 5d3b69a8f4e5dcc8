"""A file or a shipped name → `Mission`.

- `shipped`: which file a word means. `cache`: compiled missions, kept by content. `load`: any mission file → `Mission`.
"""
