"""Text → the same text laid out the one way.

- `layout`: statements, blocks, comments and blank lines as the author has them. `spacing`: spaces between tokens.
- `formatter`: both → the new text.
"""
