"""The source of decisions of a served episode: answers calls, flies the vehicles, keeps the pace.

At each boundary it takes the pictures and states of the tick, answers every call that has arrived, and lets the mission
go on when its pace says so. Time stands still while no client is connected.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from lingjing.errors import UsageError
from lingjing.kernel.barrier import Barrier
from lingjing.kernel.step import Kernel, Published
from lingjing.mission.instance import Datum, Instance
from lingjing.mission.vocabulary import PHOTO
from lingjing.scene.city import City
from lingjing.scene.sight import SightLines
from lingjing.scene.terrain import Terrain
from lingjing.serve.airsim.context import Context
from lingjing.serve.airsim.methods import answer
from lingjing.serve.airsim.missions import END, ENDING
from lingjing.serve.airsim.server import Call, CallServer
from lingjing.serve.airsim.vehicles import Fleet, Surroundings, Vehicle
from lingjing.trace.records import DEAD, REFUSED, Action, Decision, DecisionRecord, Outgoing

Pace = Literal["wall", "fast", "wait"]
"""The passing of mission time while no call waits for it: as the wall clock, as fast as possible, or not at all."""

_PATIENCE_S = 0.25
"""Longest wait for a call before the connections are looked at again, seconds (chosen)."""
_GRACE_S = 0.005
"""Wall time that a client has for its next call after an answer, before a tick begins, seconds (chosen). It decides
only at which tick a call arrives."""
_LONGEST_BOUNDARY_S = 0.2
"""Wall time after which a tick begins although more calls arrive, seconds (chosen)."""
_MOST_NOTED = 100
"""Most calls of one boundary that a thought names (chosen)."""
_LONGEST_NOTE = 200
"""Most letters of a call's arguments in a thought (chosen)."""


class EpisodeEnded(KeyboardInterrupt):
    """A client, or the leaving of the last one, ends an episode that cannot end by a message."""


class Ending:
    """The reason for which the source ended the last episode."""

    def __init__(self) -> None:
        self.asked = False
        """True if a client or the leaving of the last one ended it."""
        self.call: Call | None = None
        """The call of `reset` that waits for the next episode; None if there is no next one."""
        self.cars: frozenset[str] = frozenset()
        """Names of the cars under control. As in AirSim, `reset` takes that of multirotors alone."""


def served_agents(instance: Instance) -> tuple[tuple[str, str], ...]:
    """Return (entity, agent) of the vehicles that clients fly. Raises `UsageError` without one."""
    entities = {entity.id: entity for entity in instance.entities}
    agent_of: dict[str, str] = {}
    for agent in instance.agents:
        for name in agent.controls:
            if entities[name].engine in ("multirotor", "road"):
                agent_of.setdefault(name, agent.id)
    if not agent_of:
        raise UsageError(f"mission `{instance.mission}` has no drone or car that an agent controls", hint="try ssr")
    return tuple(agent_of.items())


class ClientSource:
    """Decisions of clients for the agents of vehicles, and of policies for the others."""

    def __init__(
        self,
        kernel: Kernel,
        barrier: Barrier,
        city: City,
        server: CallServer,
        pace: Pace,
        ending: Ending,
        *,
        once: bool,
        greeting: Call | None = None,
    ) -> None:
        """`once`: end when the last client has left. `greeting`: a call of `reset` that is answered at boundary 0."""
        self._server, self._barrier, self._pace, self._once = server, barrier, pace, once
        self._instance = kernel.instance
        self._city = city
        self._context: Context | None = None
        self._noted: list[str] = []
        self._next_wall = 0.0
        self._ending, self._greeting = ending, greeting
        self._goes_on_after = True
        self._sent: dict[str, Action] = {}
        self._ends_by_message = any(message.kind == ENDING for message in kernel.instance.messages)

    @property
    def ambient_random(self) -> frozenset[str]:
        """Agents with a call that used an unseeded global random generator."""
        return self._barrier.ambient_random

    def decide(self, published: Published, exhausted: Mapping[str, str]) -> tuple[DecisionRecord, ...]:
        """Answer calls until the mission goes on; return the decisions of all agents."""
        context = self._arrive(published)
        outside = {vehicle.agent.id for vehicle in context.fleet.vehicles}
        self._goes_on_after = self._goes_on_after and self._serve(context)
        goes_on = self._goes_on_after
        actions = self._sent = self._actions(context) if goes_on else {}
        messages = () if goes_on else (Outgoing(kind=ENDING, body={"text": END}),)
        thought, self._noted = "\n".join(self._noted), []
        records = self._barrier.decide(published, {**exhausted, **dict.fromkeys(outside, "flown by a client")})
        decided = {record.agent: record for record in records}
        for number, agent in enumerate(sorted(outside)):
            note = thought if number == 0 else ""
            decision = Decision(command=actions.get(agent), messages=messages if number == 0 else (), thought=note)
            decided[agent] = DecisionRecord(agent=agent, decision=decision)
        return tuple(decided[agent.id] for agent in self._instance.agents if agent.id in decided)

    def close(self) -> None:
        """End every call that waits."""
        self._barrier.close()
        if self._context is not None:
            for call in (*self._context.flying.values(), *(wait.call for wait in self._context.waits)):
                call.fail("the episode is over")
            if self._context.run_call is not None:
                self._context.run_call.fail("the episode is over")
            for vehicle in self._context.fleet.vehicles:
                vehicle.driver.close("the episode is over")

    def _arrive(self, published: Published) -> Context:
        """Take over the states, pictures and events of a boundary."""
        record = published.record
        states = {body.id: body for body in record.snapshots[-1].states}
        first = self._context is None
        if self._context is None:
            self._context = self._begin(states)
        context = self._context
        context.time_s, context.states = record.time_s, states
        for vehicle in context.fleet.vehicles:
            vehicle.update(states[vehicle.entity.id], 0.0 if first else context.tick_s)
            for event in record.task_events:
                if event.kind == "collided" and event.entities[:1] == (vehicle.entity.id,):
                    vehicle.collide(event.entities[1] if len(event.entities) > 1 else "", record.time_s)
        self._take_refusals(context, published)
        self._take_drives(context, published)
        self._take_pictures(context, published)
        for vehicle in context.fleet.vehicles:
            vehicle.pilot.look(vehicle.body, context.time_s)
        if context.run_call is not None and context.time_s >= context.run_until_s - 1e-9:
            context.run_call.succeed()
            context.run_call = None
        if self._greeting is not None:
            self._greeting.succeed()
            self._greeting = None
        return context

    def _begin(self, states: Mapping[str, Any]) -> Context:
        agents = {agent.id: agent for agent in self._instance.agents}
        entities = {entity.id: entity for entity in self._instance.entities}
        vehicles = tuple(
            Vehicle(entities[name], agents[agent], states[name]) for name, agent in served_agents(self._instance)
        )
        for vehicle in vehicles:
            vehicle.controlled = vehicle.name in self._ending.cars
        objects = tuple(entity.id for entity in self._instance.entities if "position" not in entity.hidden)
        around = Surroundings(Terrain(self._city), SightLines(lambda: self._city), self._city.bounds)
        return Context(self._instance, Fleet(vehicles), around, objects)

    def _take_refusals(self, context: Context, published: Published) -> None:
        """End the tasks and pictures of vehicles with a command that the kernel or the engine has refused."""
        tick = published.record.tick
        refused = {
            receipt.resource: receipt.detail or receipt.reason
            for receipt in published.record.receipts
            if receipt.status in REFUSED and receipt.tick == tick
        }
        for action in self._sent.values():
            if action.resource is None or action.resource not in refused:
                continue
            vehicle = context.fleet.find(action.resource)
            if action.verb == PHOTO:
                for wait in [wait for wait in context.waits if wait.vehicle is vehicle]:
                    context.waits.remove(wait)
                    wait.call.fail(f"no picture of `{vehicle.name}`: {refused[action.resource]}")
            elif not vehicle.flies:
                vehicle.driver.refused(action.verb, f"`{vehicle.name}`: {refused[action.resource]}")
            else:
                if vehicle.name in context.flying:
                    context.flying[vehicle.name].fail(f"`{vehicle.name}`: {refused[action.resource]}")
                vehicle.pilot.cancel()
                vehicle.pilot.landed()

    def _take_drives(self, context: Context, published: Published) -> None:
        """Take over the receipts of the commands to cars."""
        cars = {vehicle.entity.id: vehicle.driver for vehicle in context.fleet.vehicles if not vehicle.flies}
        sent = {action.resource: action.verb for action in self._sent.values()}
        for receipt in published.record.receipts:
            driver = cars.get(receipt.resource)
            if driver is None:
                continue
            verb = sent.get(receipt.resource) if receipt.tick == published.record.tick else None
            if verb is None:  # an earlier command; what `stop` has ended is not the running one any more
                if receipt.status == "completed" or (receipt.status in REFUSED and receipt.reason != "preempted"):
                    driver.ended()
            elif verb != PHOTO and receipt.status == "accepted":
                driver.accepted(verb)
            elif verb != PHOTO and receipt.status == "completed":
                driver.ended()

    def _take_pictures(self, context: Context, published: Published) -> None:
        for wait in tuple(context.waits):
            seen = published.observations[wait.vehicle.agent.id]
            for picture in seen.pictures:
                if picture.entity == wait.vehicle.entity.id and picture.tick == seen.tick:
                    wait.pictures.setdefault(picture.camera, picture)
            absent = [lost for lost in seen.absent if lost.entity == wait.vehicle.entity.id]
            if wait.missing and not absent and wait.vehicle.body.status != DEAD:
                continue
            context.waits.remove(wait)
            if not wait.missing:
                wait.call.succeed(wait.answer(wait.pictures))
            else:
                reason = absent[0].reason if absent else "the vehicle has crashed"
                wait.call.fail(f"no picture of `{wait.vehicle.name}`: {reason}")

    def _serve(self, context: Context) -> bool:
        """Answer calls until the next tick is to begin. Returns False if it is the last one, which ends the episode.

        Raises `EpisodeEnded` if the mission has no message that ends it.
        """
        self._next_wall = max(self._next_wall + context.tick_s, time.monotonic())
        answered, latest = True, time.monotonic() + _LONGEST_BOUNDARY_S
        while True:
            if time.monotonic() >= latest and self._goes_on(context):  # a client with endless calls delays no other
                return True
            patience = self._patience(context, answered=answered)
            try:
                call = self._server.calls.get(timeout=patience) if patience > 0.0 else self._server.calls.get_nowait()
            except queue.Empty:
                if self._goes_on(context):
                    return True
                answered = False
                continue
            if call is None:
                self._part(context)
                if self._once and self._server.served and not self._server.clients:
                    return self._end(None)
            elif call.client.open:
                self._note(call)
                answer(context, call)
                answered = True
                if context.resets:
                    return self._end(call)

    def _patience(self, context: Context, *, answered: bool) -> float:
        """Return the wall time to wait for the next call, seconds."""
        if context.waiting or self._pace == "fast":
            return _GRACE_S if answered and not context.waiting else 0.0 if self._goes_on(context) else _PATIENCE_S
        if self._pace == "wall":
            return (
                min(max(self._next_wall - time.monotonic(), 0.0), _PATIENCE_S) if self._runs(context) else _PATIENCE_S
            )
        return _PATIENCE_S

    def _goes_on(self, context: Context) -> bool:
        """Return whether a tick may begin."""
        if context.waits or context.run_call is not None:
            return True
        if not self._runs(context):
            return False
        if context.flying or context.steering or self._pace == "fast":
            return True
        return self._pace == "wall" and time.monotonic() >= self._next_wall

    def _runs(self, context: Context) -> bool:
        return any(client.admitted for client in tuple(self._server.clients)) and not context.paused

    def _part(self, context: Context) -> None:
        """Drop the clients that have gone."""
        present = set(self._server.clients)
        calls = (*context.flying.values(), *(wait.call for wait in context.waits), context.run_call)
        for client in {call.client for call in calls if call is not None} - present:
            self._noted.append(f"airsim: {client.name} has gone")
            context.drop(client)

    def _end(self, call: Call | None) -> bool:
        self._ending.asked, self._ending.call = True, call
        vehicles = self._context.fleet.vehicles if self._context is not None else ()
        self._ending.cars = frozenset(each.name for each in vehicles if each.controlled and not each.flies)
        if not self._ends_by_message:
            raise EpisodeEnded
        return False

    def _note(self, call: Call) -> None:
        """Note a call for the trace."""
        if len(self._noted) < _MOST_NOTED:
            arguments = ", ".join(map(repr, call.arguments)).encode("ascii", "backslashreplace").decode()
            self._noted.append(f"airsim: {call.client.name}: {call.method}({arguments[:_LONGEST_NOTE]})")

    def _actions(self, context: Context) -> dict[str, Action]:
        """Return one command for each agent: a picture first, else the command of a vehicle."""
        actions: dict[str, Action] = {}
        for wait in context.waits:
            entity, camera = wait.vehicle.entity.id, wait.missing[0]
            placement = context.placements.get((entity, camera))
            arguments: dict[str, Datum] = {"camera": camera, **(placement.arguments if placement is not None else {})}
            arguments |= context.skies.arguments(self._instance.scene.origin, context.time_s)
            photo = Action(verb=PHOTO, resource=entity, arguments=arguments)
            actions.setdefault(wait.vehicle.agent.id, photo)
        for vehicle in context.fleet.vehicles:
            if vehicle.agent.id in actions:
                continue
            action = vehicle.pilot.action() if vehicle.flies else vehicle.driver.action()
            if action is not None:
                actions[vehicle.agent.id] = action
        return actions


def vehicle_agents(instance: Instance) -> Sequence[str]:
    """Return the agents that clients play."""
    return tuple(dict.fromkeys(agent for _, agent in served_agents(instance)))
