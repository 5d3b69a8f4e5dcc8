"""Passes over entities: roles and agents, assets and targets with their hidden values, regions, grids, message kinds
and the bus.
"""

from __future__ import annotations

from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.expression_text import spell
from lingjing.mission.graph.builder import GraphBuilder
from lingjing.mission.graph.guards import Presence, either
from lingjing.mission.graph.types import NodeKind
from lingjing.mission.vocabulary import EVERYONE

_BUS = "comms"
"""Name of the bus: that of the block that declares it."""

_BUILT_IN = {"events": "adjudicated and engine events", "peers": "the other agents"}
"""Observation sources without a declaration, and their descriptions."""

_STORES = ("endurance", "payload")
"""Properties with the amount that an asset can spend or carry, besides its states."""


def add_roles(mission: model.Mission, draft: GraphBuilder) -> None:
    """A node for every role of an agent. It exists wherever one of its agents exists."""
    for role in dict.fromkeys(agent.role for agent in mission.agents):
        presences = (draft.presence(agent.when) for agent in mission.agents if agent.role == role)
        at = either((each for each in presences if each), draft.modes)
        if at:
            draft.node("role", role, at=at)


def add_agents(mission: model.Mission, draft: GraphBuilder) -> None:
    """Agents within their roles."""
    for agent in mission.agents:
        at = draft.presence(agent.when)
        if at is None:
            continue
        role = draft.need(agent.role, f"the agent `{agent.name}`", "role")
        node = draft.node(
            "agent",
            agent.name,
            title=draft.group_title(agent.name, agent.count),
            text=agent.prompt,
            count=draft.count(agent.count),
            within=role,
            at=at,
        )
        draft.edge("plays", node, role)


def add_regions(mission: model.Mission, draft: GraphBuilder) -> None:
    """Named regions, and edges to the regions in their shapes."""
    for region in mission.regions:
        draft.node("region", region.name, detail=_shape(region.shape), text=spell(region.shape))
    for region in mission.regions:
        for part in ex.parts(region.shape):
            if isinstance(part, ex.Ref) and part.kind == "region":
                source = draft.need(part.name, f"the region `{region.name}`", "region")
                draft.edge("requires", f"region:{region.name}", source, label="from")


def add_grids(mission: model.Mission, draft: GraphBuilder) -> None:
    """Search grids, each within its region."""
    for grid in mission.grids:
        region = draft.need(grid.region, f"the grid `{grid.name}`", "region")
        size = f"{draft.value(grid.rows)} × {draft.value(grid.columns)}"
        node = draft.node("grid", grid.name, detail=f"{size}, overlap {draft.share(grid.overlap)}", within=region)
        draft.edge("requires", node, region, label="over")


def add_entities(mission: model.Mission, draft: GraphBuilder) -> None:
    """Assets and targets; then their hidden values, their resources, and edges to entities that their
    properties name."""
    present = tuple((group, at) for group in mission.groups if (at := draft.presence(group.when)))
    for group, at in present:
        draft.node(
            group.role,
            group.name,
            title=draft.group_title(group.name, group.count),
            detail=group.type,
            text=_abilities(group),
            count=draft.count(group.count),
            at=at,
        )
    for group, _ in present:
        for item in group.properties:
            _add_property(group, item, draft)


def add_messages(mission: model.Mission, draft: GraphBuilder) -> None:
    """The bus, and the message kinds that roles send on it."""
    if not mission.messages:
        return
    limits = [f"delay {spell(mission.comms.delay)}"] if mission.comms.delay else []
    limits += [f"payload ≤ {spell(mission.comms.payload)}"] if mission.comms.payload else []
    limits += [f"range {spell(mission.comms.range)}"] if mission.comms.range else []
    limits += [f"loss {spell(mission.comms.loss)}"] if mission.comms.loss else []
    bus = draft.node("channel", _BUS, title="bus", detail=", ".join(limits))
    hub = mission.comms.hub and draft.find(mission.comms.hub, "agent")
    if hub and "star" in draft.modes:
        alone = draft.modes == ("star",)
        draft.edge("requires", bus, hub, label="hub", at=Presence("" if alone else "mode == star", ("star",)))
    for kind in mission.messages:
        _add_message(kind, bus, draft)


def add_controls(mission: model.Mission, draft: GraphBuilder) -> None:
    """Edges from agents to the assets that they embody, and from roles to the assets that they may command."""
    for agent in mission.agents:
        source = draft.find(agent.name, "agent")
        for expr in agent.controls if source else ():
            for target in groups_in(expr, draft):
                draft.edge("controls", str(source), target, label=_member(expr))
    for grant in mission.authorities:
        at, role = draft.presence(grant.when), draft.find(grant.role, "role")
        for target in groups_in(grant.resource, draft) if at and role else ():
            draft.edge("may_command", str(role), target, label=_member(grant.resource), at=at)


def add_observations(mission: model.Mission, draft: GraphBuilder) -> None:
    """Edges from every agent to its observation sources: entities, grids and the built-in channels."""
    for agent in mission.agents:
        source = draft.find(agent.name, "agent")
        fields_of: dict[str, list[str]] = {}
        for channel in agent.observes if source else ():
            for target in _observed(channel.source, agent.name, draft):
                fields_of.setdefault(target, []).extend(channel.fields)
        for target, fields in fields_of.items():
            label = "" if "*" in fields else ", ".join(dict.fromkeys(fields))
            draft.edge("observes", str(source), target, label=label)


def add_reveals(mission: model.Mission, draft: GraphBuilder) -> None:
    """Edges for the declared exceptions of `hidden`."""
    for reveal in mission.reveals:
        role = draft.find(reveal.role, "role")
        for entity in groups_in(reveal.entity, draft) if role else ():
            draft.edge("reveals", entity, str(role), label=reveal.what)


def groups_in(expr: ex.Expr, draft: GraphBuilder) -> tuple[str, ...]:
    """The assets and targets that an expression names, once each, in order."""
    names = (part.name for part in ex.parts(expr) if isinstance(part, ex.Ref) and part.kind in ("group", "entity"))
    return tuple(dict.fromkeys(node for name in names if (node := draft.find(name, "asset", "target"))))


# -- private


def _add_property(group: model.Group, item: model.Property, draft: GraphBuilder) -> None:
    owner = f"{group.role}:{group.name}"
    relation_text = spell(item.value) if item.relation == "=" else f"{item.relation} {spell(item.value)}"
    source = owner
    if item.hidden:
        source = draft.node(
            "fact",
            f"{group.name}.{item.name}",
            title=item.name,
            detail=_gist(item.value) or relation_text,
            text=f"{item.name} {item.relation} {spell(item.value)}",
            within=owner,
        )
        draft.edge("hides", owner, source)
    elif group.role == "asset" and (item.state or item.plain in _STORES):
        store = draft.node(
            "resource", f"{group.name}.{item.name}", title=_bare(item.name), detail=relation_text, within=owner
        )
        draft.edge("requires", owner, store)
    for part in ex.parts(item.value):
        if isinstance(part, ex.Ref) and part.kind in ("region", "grid", "group", "entity"):
            kinds: tuple[NodeKind, ...] = ("region", "grid", "asset", "target")
            place = draft.find(part.name, *kinds)
            if place and place != owner:
                draft.edge("requires", source, place, label="" if item.hidden else item.name)


def _gist(value: ex.Expr) -> str:
    """A short form of a draw from a list, because the list itself is too long for a line; "" for other expressions."""
    if isinstance(value, ex.Draw):
        for argument in value.arguments:
            if isinstance(argument, ex.Sequence):
                return f"~ {value.distribution} of {len(argument.items)}"
    return ""


def _add_message(kind: model.MessageKind, bus: str, draft: GraphBuilder) -> None:
    at = draft.presence(kind.when)
    senders, readers = (_roles(names, draft) for names in (kind.senders, kind.recipients))
    if at is None or not senders or not readers:
        return
    fields = ", ".join(f"{field.name}{'?' if field.optional else ''}: {field.type}" for field in kind.fields)
    node = draft.node("channel", kind.name, detail=kind.type, text=fields, within=bus, at=at)
    draft.edge("requires", node, bus)
    for role in senders:
        draft.edge("speaks_to", role, node)
    for role in readers:
        draft.edge("speaks_to", node, role)


def _roles(names: tuple[str, ...], draft: GraphBuilder) -> tuple[str, ...]:
    """The nodes of the named roles in the modes shown; `all` names every role."""
    if EVERYONE in names:
        return draft.all_of("role")
    return tuple(node for name in names if (node := draft.find(name, "role")))


def _observed(source: ex.Expr, agent: str, draft: GraphBuilder) -> tuple[str, ...]:
    groups = groups_in(source, draft)
    if groups or not isinstance(source, ex.Symbol | ex.Ref):
        return groups
    if isinstance(source, ex.Ref) and source.kind in ("group", "entity"):
        return ()  # the entity does not exist in the modes shown
    if source.name in _BUILT_IN and not draft.has(f"channel:{source.name}"):
        draft.node("channel", source.name, detail=_BUILT_IN[source.name])
    kinds: tuple[NodeKind, ...] = ("grid", "channel", "region")
    return (draft.need(source.name, f"what `{agent}` observes", *kinds),)


def _abilities(group: model.Group) -> str:
    cameras = ", ".join(f"{camera.name} ({'+'.join(camera.channels)})" for camera in group.cameras)
    verbs = ", ".join(verb.name for verb in group.verbs)
    state = ", ".join(item.name for item in group.properties if item.state and not item.hidden)
    lines = (
        f"engine: {group.engine}",
        state and f"state: {state}",
        cameras and f"cameras: {cameras}",
        verbs and f"verbs: {verbs}",
    )
    return "\n".join(line for line in lines if line)


def _shape(shape: ex.Expr) -> str:
    if isinstance(shape, ex.Call) and shape.function == "polygon":
        return f"polygon of {len(shape.arguments)} corners"
    return shape.function if isinstance(shape, ex.Call) else spell(shape)


def _member(expr: ex.Expr) -> str:
    return spell(expr) if isinstance(expr, ex.Index) else ""


def _bare(name: str) -> str:
    """A property's name without the suffix of its unit."""
    return name.rsplit("_", 1)[0] if "_" in name else name
