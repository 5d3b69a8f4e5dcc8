"""The language server: completion, hover, signatures, navigation and fixes for `.ljs`, from the compiler's tables.

An *occurrence* is a name at a place in the text; its *key* identifies its meaning. The *context* of a cursor is the
blocks around it and the unfinished statement before it.

The modules in control-flow order:

- `positions`: the compiler's offsets ↔ the protocol's lines and code units.
- `names`: declarations and uses of names, from the syntax tree.
- `analysis`: one version of one text: tree, names, symbol tables, diagnostics.
- `context`: the context of a cursor in an unfinished text. `pattern`: the continuations of an unfinished statement.
  `complete`: the proposals there.
- `explain`: Markdown about a name, a unit or a keyword. `outline`: the symbols of a file.
- `signatures`: the call around a cursor. `colours`: semantic tokens. `folding`: foldable lines. `hints`: units.
- `rename`: the edits of a renaming, or the reason why it is impossible.
- `server`: the protocol. It alone imports pygls, and only `lingjing lsp` imports it.

All modules except `server` consist of plain functions from texts and offsets to values. No module writes files.
"""
