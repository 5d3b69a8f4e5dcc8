"""The agents, message kinds and the message bus of an instance."""

from __future__ import annotations

import math

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import instance_rules, model
from lingjing.mission.evaluate import Members, Scope, evaluate, members, number
from lingjing.mission.instance import AgentSpec, ChannelSpec, CommsSpec, MessageSpec
from lingjing.mission.instance_entities import at_path, holds, member_ids
from lingjing.mission.vocabulary import EVERYONE


def agents(mission: model.Mission, scope: Scope) -> tuple[AgentSpec, ...]:
    """The active agents in declaration order, each with every resource that it may command."""
    grants = tuple(grant for grant in mission.authorities if holds(grant.when, scope))
    return tuple(
        spec for agent in mission.agents if holds(agent.when, scope) for spec in _agents(mission, agent, grants, scope)
    )


def messages(mission: model.Mission, scope: Scope, active: tuple[AgentSpec, ...]) -> tuple[MessageSpec, ...]:
    """The message kinds that can be sent in this mode, without roles that no agent has in it."""
    roles = {spec.role for spec in active}
    specs = (
        MessageSpec(
            kind=kind.name,
            type=kind.type,
            category=kind.category,
            fields=kind.fields,
            senders=tuple(role for role in kind.senders if role in roles or role == EVERYONE),
            recipients=tuple(role for role in kind.recipients if role in roles or role == EVERYONE),
        )
        for kind in mission.messages
        if holds(kind.when, scope)
    )
    return tuple(spec for spec in specs if spec.senders and spec.recipients)


def comms(mission: model.Mission, scope: Scope, active: tuple[AgentSpec, ...]) -> CommsSpec:
    """The settings of the bus: star mode routes through one agent, broadcast mode through none."""
    path = f"{mission.name}/comms"
    with at_path(path):
        delay = 1 if mission.comms.delay is None else _ticks(mission.comms.delay, scope)
        payload = 4000 if mission.comms.payload is None else round(number(mission.comms.payload, scope))
        if delay < 1:
            raise MissionError(f"a delay of {delay} ticks", hint="the shortest delay of a message is one tick")
        if payload < 1:
            raise MissionError(f"a payload of {payload} bytes is too small for any message")
        reach = None if mission.comms.range is None else number(mission.comms.range, scope)
        loss = 0.0 if mission.comms.loss is None else number(mission.comms.loss, scope)
        if not 0 <= loss <= 1:
            raise MissionError(f"a loss of {loss:.0%}", hint="a share of the messages, 0 % to 100 %")
        if scope.mode in ("star", "broadcast", "single"):
            return CommsSpec(
                mode=scope.mode,  # type: ignore[arg-type]
                hub=_hub(mission, active) if scope.mode == "star" else None,
                delay_ticks=delay,
                payload_bytes=payload,
                range_m=reach,
                loss=loss,
                receipts=mission.comms.receipts,
            )
        raise MissionError(f"mode '{scope.mode}' is not known", hint="a mode is star, broadcast or single")


def _hub(mission: model.Mission, active: tuple[AgentSpec, ...]) -> str:
    ids = [spec.id for spec in active]
    if mission.comms.hub is None:
        raise MissionError("star mode has no hub", hint="name one: comms { hub = commander when mode == star }")
    if mission.comms.hub not in ids:
        raise MissionError(
            f"the hub '{mission.comms.hub}' is no agent in star mode", hint=f"active agents are {', '.join(ids)}"
        )
    return mission.comms.hub


def _ticks(expr: ex.Expr, scope: Scope) -> int:
    """A delay in ticks; a delay in seconds is rounded up to whole ticks."""
    value = number(expr, scope)
    in_time = isinstance(expr, ex.Number) and expr.unit not in ("", "tick", "ticks")
    return math.ceil(value / scope.tick_s - 1e-9) if in_time else math.ceil(value)


def _agents(
    mission: model.Mission, agent: model.Agent, grants: tuple[model.Authority, ...], scope: Scope
) -> tuple[AgentSpec, ...]:
    specs = []
    for k, agent_id in enumerate(member_ids(agent.name, agent.count, scope), start=1):
        local = scope.binding(agent.index, float(k))
        with at_path(f"{mission.name}/{agent_id}"):
            controls = _resources(agent.controls, local)
            granted = _resources(tuple(grant.resource for grant in grants if grant.role == agent.role), local)
            specs.append(
                AgentSpec(
                    id=agent_id,
                    name=agent.name,
                    index=k,
                    role=agent.role,
                    controls=controls,
                    commands=tuple(dict.fromkeys(controls + granted)),
                    observes=tuple(
                        spec
                        for channel in agent.observes
                        if holds(channel.when, local)
                        for spec in _channel(mission, channel, local)
                    ),
                    prompt=agent.prompt,
                    budget=instance_rules.allowance(agent.budget, local),
                )
            )
    return tuple(specs)


def _resources(expressions: tuple[ex.Expr, ...], scope: Scope) -> tuple[str, ...]:
    return tuple(dict.fromkeys(entity for expr in expressions for entity in members(expr, scope)))


def _channel(mission: model.Mission, channel: model.Channel, scope: Scope) -> tuple[ChannelSpec, ...]:
    value = evaluate(channel.source, scope)
    match value:
        case "events":
            return (ChannelSpec(source="events", fields=channel.fields),)
        case "peers":
            return (ChannelSpec(source="peers", fields=channel.fields),)
        case str() if any(grid.name == value for grid in mission.grids):
            return (ChannelSpec(source="grid", name=value, fields=channel.fields),)
        case Members(ids=ids):
            return tuple(ChannelSpec(source="entity", name=entity, fields=channel.fields) for entity in ids)
    grids = ", ".join(grid.name for grid in mission.grids)
    raise MissionError(
        f"'{value}' cannot be observed", hint=f"observe an entity, 'peers', 'events' or a grid ({grids or 'none here'})"
    )
