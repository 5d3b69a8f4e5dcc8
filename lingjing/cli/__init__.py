"""The command line: one module a verb, each with `add_parser(subparsers)` and `handler(args) -> int`.

`main` picks the verb, imports only its module and turns errors into messages and exit codes. `run` plays episodes
with `pairs` (name=value options), `missions` (which file is meant), `progress` (the live line) and `scoreboard` (the
table and the JSON object). `plugins`, `new` and `doctor` look around; `libraries` lists the system libraries that
packages cannot bring.
"""
