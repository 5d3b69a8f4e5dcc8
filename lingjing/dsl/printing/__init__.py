"""`Mission` → text that compiles to it.

- `phrases`: expressions and quantities. `imports`: types and records → the libraries that declare them.
- `layouts`: the layouts of statements → text. `printer`: the whole mission.
"""
