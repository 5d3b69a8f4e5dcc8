"""Text → syntax tree.

The parser is an LALR(1) machine over tokens. Its grammar is `ljs.lark`; its tables are generated and shipped.

The modules in control-flow order:

- `tokens`: the kinds of tokens and the words of the language. `lexer`: text → tokens, with newlines only at statement
  boundaries and balanced braces ← `indentation`, where braces are missing. `lookalikes`: names in confusable letters.
- `tree`: the nodes of the syntax tree. `ljs.lark`: the grammar. `tables`: its LALR(1) tables.
- `builder`: reductions → nodes. `parser`: tokens → tree, with recovery at statements.
"""
