"""`Mission` → text that compiles to it.

- `phrases`: expressions and quantities. `imports`: types and records → the libraries that declare them.
- `printer`: the whole mission.
"""
