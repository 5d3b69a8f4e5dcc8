"""Text → syntax tree.

In the order of the work:

- `tokens`: the kinds of tokens and the words of the language. `lexer`: text → tokens; newlines only at statement
  boundaries, braces balanced ← `indentation`, where they do not. `lookalikes`: names whose letters look like others.
- `tree`: the nodes of the syntax tree. `ljs.lark`: the grammar. `tables`: its LALR(1) tables, which ship.
- `builder`: reductions → nodes. `parser`: tokens → tree, with recovery at the statement.
"""
