"""What a hub does: passes on what is meant for others, gives orders when they can be carried out."""

from __future__ import annotations

from lingjing.plugins.policy import STOP, Brief, Datum, Envelope, Outgoing
from lingjing.plugins.tasks import Task
from lingjing_agents.oracle.ability import Ability
from lingjing_agents.oracle.composing import MessageComposer
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState


class HubAbility(Ability):
    """The hub of a star."""

    def __init__(self, brief: Brief, plan: InstanceIndex, composer: MessageComposer) -> None:
        self._brief, self._plan, self._composer = brief, plan, composer
        self._roles = {peer.id: peer.role for peer in brief.peers}
        self._ordered: set[tuple[str, str]] = set()
        self._routes: dict[str, int] = {}

    def say(self, truth: PrivilegedState) -> list[Outgoing]:
        """Orders and what is passed on."""
        messages: list[Outgoing] = []
        for message in truth.inbox.messages:
            messages += self._pass_on(message, truth)
        return messages + self._cells(truth) + self._inspections(truth) + self._tasks(truth)

    def _pass_on(self, message: Envelope, truth: PrivilegedState) -> list[Outgoing]:
        """To those whom a relation says it is for: as it is, or as an order to its place."""
        said: list[Outgoing] = []
        for relation in self._plan.instance.relations:
            kind = relation.carries or relation.by
            if kind != message.kind or relation.source != self._roles.get(message.sender):
                continue
            to = tuple(name for name, role in self._roles.items() if role == relation.target and name != message.sender)
            if not to:
                continue
            if self._composer.kind(message.kind) is not None:
                said += self._composer.say(message.kind, message.body, to)
            elif "position" in message.body:
                said += self._order_there(message, to)
        return said

    def _order_there(self, message: Envelope, to: tuple[str, ...]) -> list[Outgoing]:
        body: dict[str, Datum] = {"position": message.body["position"]}
        said: list[Outgoing] = []
        for name in to:
            said += self._composer.order(name, str(message.body.get("class", "go")), body, (name,))
        return said

    def _cells(self, truth: PrivilegedState) -> list[Outgoing]:
        """At the start: to everyone whom this hub guides, its part of the search cells."""
        roles = {one.target for one in self._plan.instance.relations if one.kind == "guidance"}
        if truth.tick != 0 or not self._brief.cells:
            return []
        mates = [name for name, role in self._roles.items() if role in roles]
        said: list[Outgoing] = []
        for number, name in enumerate(mates):
            cell = self._brief.cells[number % len(self._brief.cells)]
            said += self._composer.order(name, "search", {"cell": cell.name}, (name,))
        return said

    def _inspections(self, truth: PrivilegedState) -> list[Outgoing]:
        """To the inspectors, each new route's first waypoint."""
        said: list[Outgoing] = []
        for inspection in self._plan.instance.inspections:
            route = truth.routes.get(inspection.asset)
            if route is None or self._routes.get(inspection.name) == route.number:
                continue
            self._routes[inspection.name] = route.number
            for name in inspection.by:
                agent = self._plan.owners[name].id
                if agent in self._roles:
                    body: dict[str, Datum] = {"position": route.waypoints[0]}
                    said += self._composer.order(agent, "inspect", body, (agent,))
        return said

    def _tasks(self, truth: PrivilegedState) -> list[Outgoing]:
        """To whoever deals with a target, as soon as that is permitted and, where it must be, reported."""
        said: list[Outgoing] = []
        for task in truth.left:
            if task.moves_goods or task.target in truth.unreported:
                continue
            name = self._performer(truth, task)
            if name and (name, task.target) not in self._ordered:
                self._ordered.add((name, task.target))
                body: dict[str, Datum] = {"position": truth.states[task.target].position}
                said += self._composer.order(name, task.name, body, (name,))
        return said

    def _performer(self, truth: PrivilegedState, task: Task) -> str:
        able = [
            body.id
            for body in self._plan.able(task)
            if self._plan.owners[body.id].id in self._roles
            and not any(truth.forbidden(body.id, verb.name) for verb in body.verbs if verb.name != STOP)
        ]
        if not able:
            return ""
        return self._plan.owners[min(able, key=lambda name: truth.distance(name, task.target))].id


def hub_abilities(brief: Brief, plan: InstanceIndex, composer: MessageComposer) -> list[Ability]:
    """The hub alone leads."""
    return [HubAbility(brief, plan, composer)] if brief.hub == brief.agent else []
