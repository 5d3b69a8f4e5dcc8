"""Text → syntax tree.

The parser is an LALR(1) machine over tokens. Its grammar is `ljs.lark`; its tables are generated and shipped.

The modules in control-flow order:

- `tree`: the nodes of the syntax tree. `keys`: the properties that a block may have.
- `statements`: the table of all statements, in the terms of `statement_kinds`. Grammar, lexer, builder, printer, pages
  and the language server read it.
- `tokens`: the kinds of tokens and the words of the language. `lexer`: text → tokens, with newlines only at statement
  boundaries and balanced braces ← `indentation`, where braces are missing. `lookalikes`: names in confusable letters.
- `foreign`: spellings of other languages and keyboards. `foreign_text`: the part of the lexer that reads them.
- `ljs.lark`: the grammar. `tables`: its LALR(1) tables.
- `builder`: reductions → nodes. `parser`: tokens → tree, with recovery at statements; `repairs`: the small changes with
  which a faulty statement can be read; `idioms`: phrases of other languages, with the way to say them here.
"""
