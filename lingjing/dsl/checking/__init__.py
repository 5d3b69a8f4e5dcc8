"""Syntax tree → `lingjing.mission.model.Mission`: resolution of names, types and dimensions, and hidden values.

A *declaration* (an asset, a rule, …) becomes a part of the mission. An *expression* gets a *type* (a quantity of a
dimension, a position, …). A *hidden* value may not become visible to agents; its *taint* is the path from the
declaration that hides it to the place that reads it.

The modules in control-flow order:

- `library`: the files that `use` names. `kept_libraries`: the checked standard library, from a file.
- `toplevel`: the top of a file. `inherit`: the statements that `extends` adds.
- `values`: checked expressions. `keys`: the properties that a block may have.
- `scope`: the tables of declared names. `typenames`: types in words.
- `unknown`: names without a declaration. `shipped_names`: the names that the standard library declares.
- `corrections`: values of the wrong kind in their right spelling.
- `expressions`: the base of the checkers of expressions, and the numbers that expressions always equal.
- `calls`, `aggregates`, `status_words`, `senders`, `elaborate`: expressions with their types and taints.
- `blocks`: the properties of a block against its keys. `properties`: their form in the mission.
- `types`, `bodies`, `interactions`, `settings`, `entities`, `equipment`, `behaviours`, `agents`, `wording`, `rules`,
  `conduct`, `events`, `studies`, `orders`, `expectations`: a checker for each kind of declaration.
- `unseen_pictures`: the warning for agents that observe fields of an asset but not its cameras.
- `checker`: a whole mission. `leaks`: hidden values that decide something which agents notice.
"""
