"""Pictures of the mission graph.

A picture has lanes (columns), cards (boxes of a node and the nodes inside it) and edges. Modules in control-flow order:

- `styles`: lanes, colours and words of every kind of node and edge; a new kind is a new line there.
- `sentences`: words on nodes and edges, and the sentences of their tooltips.
- `mermaid`, `dot`: the two text formats, which other programs lay out.
- `graphml`: the exchange graph for other programs, without a layout.
- `svg`: the DOT text laid out by Graphviz, with colours for light and dark pages.

In: a `lingjing.mission.graph.MissionGraph`. Out: text. The same graph gives the same text.
"""
