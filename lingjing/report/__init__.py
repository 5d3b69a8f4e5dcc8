"""A report of one's own runs: the figures of the paper as one page that needs no network, or one by one as SVG or PNG.

`places` finds what lies where a reader points → `gathering` reads it, traces one by one, into `evidence`; `trace_rows`
makes rows of traces that are no suite's → each of `figures` takes what it can show: numbers from `estimates` (`swept`
and `conditions` say what a study changes, `chosen` which episodes stand for a mission), drawings by `charts`, tables by
`lingjing.bench` → `figure_kinds` lists them, in the one shape of `figure` → `page`, or `sheet`: all drawings of one
figure side by side. A `drawing` is marks and tones; `vector` writes it as SVG, `raster` as PNG.

In: traces, rows, and folders that other verbs have written; out: bytes that are the same for the same input. Every text
is escaped. A figure without anything to show is left out, and the page says what to run for it.
"""
