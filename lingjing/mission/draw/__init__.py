"""Pictures of the mission graph, in text alone: no program or font of the system is asked.

Modules in the order a graph passes them:

- `styles`: lanes, colours and words of every kind of node and edge; a new kind is a new line there.
- `reading`: what is said on a node in place of edges to everybody; sentences for whoever points at something.
- `mermaid`, `dot`: the two plain-text formats, laid out by others.
- `lettering`, `cards`, `placing`, `drawing`: text widths; nodes as cards in lanes; their order and heights; lines.
- `svg`: a drawing as a document.

In: a `lingjing.mission.graph.MissionGraph`. Out: text. The same graph gives the same text everywhere.
"""
