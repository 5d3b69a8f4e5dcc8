"""Text → the same text laid out the one way.

- `layout`: statements, blocks, comments and blank lines as the author has them. `spacing`: spaces between tokens.
- `columns`: what is lined up in a run of lines. `formatter`: all of it → the new text.
"""
