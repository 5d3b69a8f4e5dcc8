"""Diagnostics for users and programs, and the application of fixes.

- `codes`: every code and its meaning. `render`: text and JSON. `sarif`: SARIF 2.1.0. `fixes`: applying fixes.
"""
