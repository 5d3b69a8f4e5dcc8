"""Pictures of the mission graph.

Modules in the order a graph passes them:

- `styles`: lanes, colours and words of every kind of node and edge; a new kind is a new line there.
- `sentences`: what is said on a node in place of edges to everybody; sentences for whoever points at something.
- `mermaid`, `dot`: the two text formats, laid out by others.
- `svg`: the DOT text laid out by Graphviz, with colours for dark pages.

In: a `lingjing.mission.graph.MissionGraph`. Out: text. The same graph gives the same text.
"""
