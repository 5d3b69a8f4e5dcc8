"""Adversaries: players that a benchmark of tier 1 must defeat (ADR 0055, `docs/adversaries.md`).

Each takes one way past the task: it reads no picture, no message, or something that no agent should have. An adversary
that wins more often than chance shows a fault of a mission or of the walls. `lingjing bench adversaries` plays all
plausible pairs of adversary and column; `lingjing run cd --tier 1 --policy
agents/lingjing_agents/adversaries/messages.py:Loner` plays one.

- `guesses`: `Blind`, `Flooder`, `ClockReader` and `EventReader` guess boxes on black pictures.
- `pixels`: `MaskReader` reads depth and classes, `ColourTable` reads colours that were learnt on two seeds.
- `depths`: `DepthReader` measures, and sees no colour.
- `ids`: `IdReader` reads names, numbers and their order.
- `messages`: `Deaf` receives no message, `Loner` needs none, `Whiteboard` exchanges them beside the bus.
- `streets`: `StreetSweeper` drives over every street, and neither sends nor reads a message.
- `truth`: `Introspector` reads memory, other processes and the open trace, `SeedGuesser` draws the instance again.
"""
