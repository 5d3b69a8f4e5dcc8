"""`Mission` → text that compiles to it.

- `phrases`: expressions and quantities. `imports`: types and records → the libraries they come from.
- `printer`: the whole mission.
"""
