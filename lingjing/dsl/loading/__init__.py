"""A file or the name of a shipped mission → `Mission`.

- `shipped`: the file that a word on the command line names. `cache`: compiled missions, cached by content. `load`: any
  mission file → `Mission`.
"""
