"""The studies of the project as one program: played over several sittings, stored as one record, shown as tables.

Concepts. A *program* (`suites/validity.toml`) declares *parts*. A part is a question with entrants, missions, tiers and
seeds. A *study* is a part at one tier; it is an ordinary suite in a folder of its own, so that every command for
results reads it. The adversaries are a study too. A *round* plays the next few seeds of every study, so that a program
that was stopped is balanced and its entrants are matched. The *record* says for each entrant, column and tier which
seeds were played, won and lost.

Modules in control-flow order:

- `program`  the form of the file, with all errors at once
- `studies`  the plans of the studies, and their runs in folders
- `rounds`   plays the studies in rounds, and estimates the hours
- `record`   the record of the rows
- `pages`    the tables of a record

Invariants: a round is over in every study before the next one begins. A record holds nothing but counted rows; what
was not played is named as such (ADR 0064).
"""
