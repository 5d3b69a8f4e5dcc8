"""Passes over the terms of a mission: budgets, permits, constraints, inspections and timed events."""

from __future__ import annotations

from lingjing.mission import model
from lingjing.mission.expression_text import spell
from lingjing.mission.graph.builder import GraphBuilder
from lingjing.mission.graph.entities import groups_in
from lingjing.mission.graph.needs import DECIDED, needs
from lingjing.mission.graph.rules import SUCCESS


def add_allowances(mission: model.Mission, draft: GraphBuilder) -> None:
    """Budgets of tokens, money and messages: success requires those of the mission, an agent those of its own."""
    _add_allowance(mission.budget, "", f"outcome:{SUCCESS}", draft)
    for agent in mission.agents:
        owner = draft.find(agent.name, "agent")
        if owner and agent.budget:
            _add_allowance(agent.budget, agent.name, owner, draft)


def add_limits(mission: model.Mission, draft: GraphBuilder) -> None:
    """Counted budgets of the mission and of its stages, with edges from the counted elements."""
    for limit in mission.limits:
        _add_limit(limit, "", None, draft)
    for stage in mission.stages:
        for limit in stage.limits:
            _add_limit(limit, f"{stage.name}.", f"stage:{stage.name}", draft)


def add_inspections(mission: model.Mission, draft: GraphBuilder) -> None:
    """Routes with waypoints to inspect, and their inspectors."""
    for inspection in mission.inspections:
        at = draft.presence(inspection.when)
        if at is None:
            continue
        order = "in order" if inspection.order == "strict" else "in any order"
        node = draft.node("inspection", inspection.name, detail=f"within {spell(inspection.within)}, {order}", at=at)
        for asset in groups_in(inspection.asset, draft):
            draft.edge("adjudicates", node, asset, label="route")
        if inspection.destination is not None:
            for place in groups_in(inspection.destination, draft):
                draft.edge("adjudicates", node, place, label="leads to")
        for expr in inspection.by:
            for inspector in groups_in(expr, draft):
                draft.edge("requires", node, inspector, label="by")
        channel = draft.find(inspection.replan, "channel")
        if channel:
            draft.edge("requires", node, channel, label="replan")


def add_constraints(mission: model.Mission, draft: GraphBuilder) -> None:
    """Conditions that must always hold: success requires the hard ones, the soft ones cost points."""
    for constraint, condition in zip(mission.constraints, draft.survey.of_kind("constraint"), strict=True):
        at = draft.presence(constraint.when)
        if at is None:
            continue
        cost = f", penalty {spell(constraint.penalty)}" if constraint.penalty else ""
        per = draft.find(constraint.domain, "asset", "target") if constraint.domain else None
        node = draft.node(
            "constraint",
            constraint.name,
            detail=constraint.kind + cost,
            text=f"always {spell(constraint.condition)}",
            per=per,
            at=at,
        )
        if per:
            draft.edge("adjudicates", node, per)
        for needed in needs(condition, draft):
            draft.edge("requires", node, needed)
        if constraint.kind == "hard":
            draft.edge("requires", f"outcome:{SUCCESS}", node)


def add_permits(mission: model.Mission, draft: GraphBuilder) -> None:
    """Commands with a condition: the nodes that it reads unlock them."""
    for permit, condition in zip(mission.permits, draft.survey.of_kind("permit"), strict=True):
        for asset in groups_in(permit.resource, draft):
            for needed in needs(condition, draft):
                if needed.startswith(DECIDED):
                    draft.edge("unlocks", needed, asset, label=permit.verb)
                elif needed != asset:
                    draft.edge("requires", asset, needed, label=permit.verb)


def add_happenings(mission: model.Mission, draft: GraphBuilder) -> None:
    """Events: an entity appears, vanishes or is set, the weather changes. Conditions are edges to what they read."""
    conditions = {condition.at: condition for condition in draft.survey.of_kind("event")}
    for event in mission.events:
        at = draft.presence(event.when)
        if at is None:
            continue
        name = f"{event.name}@" if draft.has(f"event:{event.name}") else event.name
        changed = (item for change in event.changes for item in change.weather)
        weather = (f"{item.name} {item.relation} {spell(item.value)}" for item in changed)
        node = draft.node("event", name, title=event.name, detail=_event_head(event), text=", ".join(weather), at=at)
        for part in ("when", "until"):
            condition = conditions.get(f"event/{event.name}/{part}")
            for needed in needs(condition, draft) if condition is not None else ():
                if needed != node:
                    draft.edge("requires", node, needed, label=part)
        for change in event.changes:
            if draft.has(f"region:{change.region}"):
                draft.edge("changes", node, f"region:{change.region}", label=change.kind)
            for entity in groups_in(change.entity, draft) if change.entity else ():
                draft.edge("changes", node, entity, label=change.kind)


# -- private


def _event_head(event: model.EventDeclaration) -> str:
    """The time or the condition of an event, with its end and its pause: `when f.heat > 0.5 until now > 90 s`."""
    head = f"at {spell(event.at)}" if event.at is not None else ""
    head += f"when {spell(event.condition)}" if event.condition is not None else ""
    head += f" until {spell(event.until)}" if event.until is not None else ""
    return head + (f" repeat every {spell(event.pause)}" if event.pause is not None else "")


def _add_allowance(
    budget: model.BudgetDeclaration | model.AllowanceDeclaration, agent: str, owner: str, draft: GraphBuilder
) -> None:
    units = (("tokens", budget.tokens), ("money", budget.money), ("messages", budget.messages))
    for name, most in units:
        if most is not None:
            full = f"{agent}.budget.{name}" if agent else f"budget.{name}"
            detail = f"≤ {spell(most)}" + (f" for {agent}" if agent else "")
            node = draft.node("resource", full, title=name, detail=detail, within=owner)
            draft.edge("requires", owner, node)


def _add_limit(limit: model.Limit, prefix: str, owner: str | None, draft: GraphBuilder) -> None:
    at = draft.presence(limit.when)
    if at is None:
        return
    counted = ", ".join(_counted(item) for item in limit.counts)
    node = draft.node(
        "resource",
        f"{prefix}{limit.name}",
        title=limit.name,
        detail=f"≤ {draft.value(limit.most)} {counted}",
        within=owner,
        at=at,
    )
    if owner:
        draft.edge("requires", owner, node)
    for item in limit.counts:
        spenders = groups_in(item.resource, draft) if item.resource else ()
        channel = draft.find(item.name, "channel") if item.kind == "message" else None
        for spender in (*spenders, *((channel,) if channel else ())):
            draft.edge("requires", spender, node, label=item.name if item.kind == "command" else "")


def _counted(item: model.Counted) -> str:
    owner = spell(item.resource) if item.resource else ""
    return ".".join(part for part in (owner, item.name) if part)
