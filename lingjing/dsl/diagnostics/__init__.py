"""Diagnostics for people and programs, and what mends the text.

- `codes`: every code and its meaning. `render`: text and JSON. `sarif`: SARIF 2.1.0. `fixes`: applying fixes.
"""
