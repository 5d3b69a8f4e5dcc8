"""Passes over rules and events: interactions, rules, stages, the outcome, and the paper's five relations."""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.expression_text import spell
from lingjing.mission.graph.builder import GraphBuilder
from lingjing.mission.graph.entities import groups_in
from lingjing.mission.graph.needs import DECIDED, needs
from lingjing.mission.graph.types import NodeKind

SUCCESS = "success"
_FAILURE = "failure"
"""Name of the node of the failure condition."""

_ENDS: tuple[NodeKind, ...] = ("role", "stage", "agent", "asset", "target", "event", "rule")
"""Kinds of nodes that a relation may connect."""
_MEANS: tuple[NodeKind, ...] = ("channel", "grid", "asset", "target", "region", "resource")
"""Kinds of nodes that a relation may name as its means."""


def add_rules(mission: model.Mission, draft: GraphBuilder) -> None:
    """The rules that the kernel adjudicates."""
    for rule in mission.rules:
        judged = " × ".join(parameter.domain for parameter in rule.parameters)
        detail = f"{judged}, one to one" if rule.matching else judged
        draft.node("rule", rule.name, detail=detail, text=spell(rule.condition))


def add_events(mission: model.Mission, draft: GraphBuilder) -> None:
    """The interactions of the groups' types, which the owning engine performs and reports."""
    performers: dict[str, list[str]] = {}
    for group in mission.groups:
        if group.role == "asset" and draft.has(f"asset:{group.name}"):
            roles = (agent.role for agent in mission.agents if f"asset:{group.name}" in _controlled(agent, draft))
            for name in dict.fromkeys((group.engine, *roles)):
                performers.setdefault(name, []).append(f"asset:{group.name}")
    for group in mission.groups:
        target = draft.find(group.name, "asset", "target")
        for interaction in group.interactions if target else ():
            event = draft.find(interaction.name, "event") or draft.node(
                "event", interaction.name, detail=f"performed by {interaction.by}"
            )
            draft.edge("requires", event, str(target))
            for performer in performers.get(interaction.by, ()):
                draft.edge("requires", event, performer)


def _controlled(agent: model.Agent, draft: GraphBuilder) -> set[str]:
    return {node for expr in agent.controls for node in groups_in(expr, draft)}


def add_unlocks(mission: model.Mission, draft: GraphBuilder) -> None:
    """The conditions of interactions."""
    for unlock in draft.survey.of_kind("unlock"):
        event = draft.find(unlock.name, "event") or draft.node("event", unlock.name)
        for node in needs(unlock, draft):
            if node.startswith(DECIDED):
                draft.edge("unlocks", node, event)
            else:
                draft.edge("requires", event, node)


def add_judgements(mission: model.Mission, draft: GraphBuilder) -> None:
    """The entities that every rule judges, and the nodes that it reads."""
    for rule, condition in zip(mission.rules, draft.survey.of_kind("rule"), strict=True):
        node = f"rule:{rule.name}"
        for parameter in rule.parameters:
            entity = draft.find(parameter.domain, "target", "asset")
            report = draft.find(parameter.domain, "channel")
            if entity:
                draft.edge("adjudicates", node, entity)
            elif report:
                draft.edge("requires", node, report)
        for needed in needs(condition, draft):
            draft.edge("requires", node, needed)


def add_stages(mission: model.Mission, draft: GraphBuilder) -> None:
    """Stages, with the group that they are counted per member of."""
    for stage in mission.stages:
        details = [f"per {stage.domain}"] if stage.domain else []
        details += [f"≤ {draft.value(stage.ticks)} ticks"] if stage.ticks else []
        details += [f"by {draft.value(stage.deadline)}"] if stage.deadline else []
        details += [f"weight {spell(stage.weight)}"] if stage.weight else []
        per = draft.find(stage.domain, "target", "asset") if stage.domain else None
        draft.node("stage", stage.name, detail=", ".join(details), text=spell(stage.condition), per=per)


def add_outcomes(mission: model.Mission, draft: GraphBuilder) -> None:
    """Success, failure, and the budget of ticks."""
    for name, condition in _outcomes(mission):
        per = next((node for domain in _domains(condition) if (node := draft.find(domain, "target", "asset"))), None)
        detail = "for every " + per.partition(":")[2] if per else ""
        draft.node("outcome", name, detail=detail, text=spell(condition), per=per)
    budget = mission.budget
    barriers = (("policy", budget.policy), ("engine", budget.engine), ("capture", budget.capture))
    ticks = draft.node(
        "resource",
        "budget.ticks",
        title="ticks",
        detail=f"≤ {spell(budget.ticks)} of {spell(mission.clock.tick)}",
        text=", ".join(f"{name} ≤ {spell(limit)}" for name, limit in barriers),
        within=f"outcome:{SUCCESS}",
    )
    draft.edge("requires", f"outcome:{SUCCESS}", ticks)


def add_completions(mission: model.Mission, draft: GraphBuilder) -> None:
    """Edges from stages and outcomes to the nodes that their conditions read."""
    for stage in draft.survey.of_kind("stage"):
        for needed in needs(stage, draft):
            draft.edge("requires", f"stage:{stage.name}", needed)
    for outcome in draft.survey.of_kind("success", "failure"):
        for needed in needs(outcome, draft):
            draft.edge("requires", f"outcome:{outcome.kind}", needed)


def add_relations(mission: model.Mission, draft: GraphBuilder) -> None:
    """The declared relations, with the element that they carry, are over, or are by as `via`."""
    for relation in mission.relations:
        at = draft.presence(relation.when)
        if at is None or _absent(relation, mission, draft):
            continue
        what = f"the relation {relation.kind}"
        word, means = next(
            ((word, name) for word in ("carries", "over", "by") if (name := getattr(relation, word))), ("", "")
        )
        draft.edge(
            relation.kind,
            draft.need(relation.source, what, *_ENDS),
            draft.need(relation.target, what, *_ENDS),
            label=word or (f"per {relation.per}" if relation.per else ""),
            via=draft.need(means, what, *_MEANS) if means else None,
            mutual=relation.mutual,
            at=at,
        )


# -- private


def _outcomes(mission: model.Mission) -> tuple[tuple[str, ex.Expr], ...]:
    failure = ((_FAILURE, mission.failure),) if mission.failure else ()
    return ((SUCCESS, mission.success), *failure)


def _domains(condition: ex.Expr) -> Iterator[str]:
    return (part.domain for part in ex.parts(condition) if isinstance(part, ex.Quantified))


def _absent(relation: model.Relation, mission: model.Mission, draft: GraphBuilder) -> bool:
    """True if a declared element of the relation exists in none of the modes shown; then the relation does not
    either."""
    declared = {agent.role for agent in mission.agents}.union(
        *({part.name for part in table} for table in (mission.agents, mission.groups, mission.messages))
    )
    named = (relation.source, relation.target, relation.carries, relation.over, relation.by)
    return any(name in declared and draft.find(name, *_ENDS, *_MEANS) is None for name in named if name)
