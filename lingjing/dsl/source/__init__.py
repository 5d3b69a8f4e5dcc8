"""A mission's text before it is read, and what is said about it.

- `text`: a text with its lines and spans; reading and decoding files.
- `reporter`: collects the diagnostics of one text.
"""
