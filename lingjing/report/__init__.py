"""Reports: the figures of the paper from one's own runs, as one page without network, or one by one as SVG or PNG.

A *place* is a file or folder that the user names. Its *evidence* is the rows of episodes, grouped by *study* (a suite,
or all single traces together), and the traces and measurements that figures show. A *figure* has *parts*; a part has
*drawings* and the tables with their numbers. A drawing is painted with matplotlib and rendered as SVG or PNG.

In control-flow order:

- `places`: the files and folders at the places, by kind. `gathering`: reads them, one trace at a time, into `evidence`;
  `trace_rows`: rows and conditions of single traces.
- `figures`: one module for each figure. They take numbers with intervals from `estimates`, changed parameters and
  options from `swept` and `conditions`, and the episodes to show from `chosen`. `figure` has the types of figures and
  parts, `figure_kinds` the list of all figures.
- `charts`: line charts, bars, divided bars and grids, laid out with the widths of `text_layout`. `drawing`: the type of
  drawings, and the palette. `painting`: drawings as SVG and PNG; it alone loads matplotlib (ADR 0030).
- `page`: the HTML page. `sheet`: all drawings of one figure on one.

The same input gives the same bytes. Every text is escaped. The page lists the figures without data, each with the
command that plays its episodes.
"""
