"""Syntax tree → `lingjing.mission.model.Mission`: what names mean, types and dimensions, the way of hidden values.

In the order of the work:

- `library`: which files `use` means. `toplevel`: the top of a file. `inherit`: what `extends` brings.
- `values`: checked expressions. `keys`: what a block may say.
- `scope`: the tables of declared names. `unknown`: names nobody declared. `typenames`: types in words.
- `constants`: the numbers that expressions always are. `expressions`: what the parts of their checking share.
- `calls`, `aggregates`, `elaborate`: expressions, typed, with the way hidden values take.
- `blocks`: properties of a block against the keys it knows. `properties`: their form in the mission.
- `types`, `bodies`, `interactions`, `settings`, `entities`, `equipment`, `agents`, `wording`, `rules`, `conduct`,
  `events`, `studies`: one checker for each sort of declaration.
- `unseen_pictures`: the warning for agents that observe fields of an asset and not its cameras.
- `checker`: a whole mission.
"""
