"""Print roles, topology, action spaces, hidden fields and radii of a compiled mission: mission_graph.py FILE MODE."""

import json
import sys
from pathlib import Path

import networkx as nx

path, mode = sys.argv[1:]
if path.endswith(".json"):
    graph = nx.node_link_graph(json.loads(Path(path).read_text(encoding="utf-8"))["graph"], edges="edges")
else:
    graph = nx.read_graphml(path, force_multigraph=True)
nodes = {name: data for name, data in graph.nodes(data=True) if mode in data["modes"].split()}
edges = [(source, target, data) for source, target, data in graph.edges(data=True) if mode in data["modes"].split()]
of = {kind: [(s, t) for s, t, data in edges if data["kind"] == kind] for kind in {data["kind"] for *_, data in edges}}
roles = {role: [agent for agent, played in of["plays"] if played == role] for _, role in of["plays"]}
hub = next((target for _, target, data in edges if data.get("label") == "hub"), None)
topology = {kind: {"from": [], "through": hub, "to": []} for kind in nodes if nodes[kind]["kind"] == "channel"}
for source, target in of.get("speaks_to", ()):
    kind, side, role = (target, "from", source) if source in roles else (source, "to", target)
    topology[kind][side].append(role)
actions = {role: {verb: {} for by, verb in of["commands"] if by == role} for role in roles}
for verb, argument in of.get("takes", ()):
    for verbs in (verbs for verbs in actions.values() if verb in verbs):
        verbs[verb][nodes[argument]["title"]] = [nodes[argument].get("least"), nodes[argument].get("most")]
hidden = {name: nodes[name]["text"] for _, name in of.get("hides", ())}
radii = {f"{s} {t}": data["radius_m"] for s, t, data in edges if "radius_m" in data}
radii |= {name: data["radius_m"] for name, data in nodes.items() if "radius_m" in data}
print(json.dumps(dict(roles=roles, topology=topology, actions=actions, hidden=hidden, radii=radii), indent=1))
