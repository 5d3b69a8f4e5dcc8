"""Text → the same text in the standard layout.

- `layout`: statements, blocks, comments and blank lines of the author's text. `spacing`: spaces between tokens.
- `formatter`: both → the new text.
"""
