"""A mission's text before parsing, and the diagnostics about it.

- `text`: a text with its lines and spans; reading and decoding of files.
- `reporter`: collects the diagnostics of one text.
"""
