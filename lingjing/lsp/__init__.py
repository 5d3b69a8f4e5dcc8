"""The language server: what an editor asks of `.ljs`, answered from the compiler's own tables.

- `positions`: offsets of the compiler ↔ lines and code units of the protocol.
- `names`: where names are declared and used, by walking the syntax tree.
- `analysis`: one version of one text: tree, names, symbol tables, diagnostics.
- `context`: what surrounds a cursor in a text that is not finished. `complete`: what could stand there.
- `explain`: what a name, a unit, a keyword is, in Markdown. `outline`: the symbols of a file.
- `rename`: the edits of a renaming, or why there can be none.
- `server`: the protocol itself; the only importer of pygls, imported by `lingjing lsp` alone.

Everything but `server` is plain functions over texts and offsets. In: texts and positions. Out: values of the
modules' own small types; nothing here writes a file.
"""
