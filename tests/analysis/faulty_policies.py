"""An oracle with one fault. Its lost episodes cover the failure families.

`agents` is imported here as a user's file would import it: the file is loaded as `faulty_policies.py:FaultyOracle`.
"""

import msgspec
from lingjing_agents.oracle.policy import OraclePolicy

from lingjing.plugins.policy import Action, Brief, Decision, Inbox, Observation, Outgoing

replace = msgspec.structs.replace

FAULTS = ("mute", "misname", "decoy", "shift", "unassigned", "late", "stalled", "astray", "stubborn", "silent")


class FaultyOracle:
    """An oracle with one fault in its decisions after tick `since`.

    - `mute` drops all reports at the place of its first report.
    - `misname` reports another class.
    - `decoy` reports another visible object as the target, once a tick, and no target.
    - `shift` moves reported positions by 400 m.
    - `unassigned` drops assignments; `late` delays them by 15 ticks.
    - `stalled` sends no command to an entity that does not fly.
    - `astray` sends an entity that does not fly back to its start.
    - `stubborn` repeats one impossible command.
    - `silent` sends no messages.
    """

    privileged = True

    def __init__(self, fault: str, since: int = 0) -> None:
        if fault not in FAULTS:
            raise ValueError(f"no fault `{fault}`")
        self._fault, self._since, self._oracle = fault, since, OraclePolicy()
        self._kept: list[tuple[int, Outgoing]] = []
        self._first: object = None

    async def reset(self, brief: Brief) -> None:
        """Store the brief."""
        self._brief = brief
        self._kinds = {kind.kind: kind.category for kind in brief.messages}
        own = [resource for resource in brief.resources if resource.embodied]
        verbs = {verb.name for resource in own for verb in resource.verbs}
        self._flies = bool(verbs & {"takeoff", "takeOff", "takeoffTo"})
        self._moves = next(
            (verb for resource in own for verb in resource.verbs if verb.name in ("moveTo", "setDestination")), None
        )
        await self._oracle.reset(brief)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the oracle's decision with the fault."""
        if not hasattr(self, "_home"):
            self._home = {entity.id: entity.position for entity in observation.entities}
        good = await self._oracle.act(observation, inbox)
        if observation.tick < self._since:
            return good
        messages = [sent for message in good.messages for sent in self._faulty(message, observation)]
        if self._fault == "decoy":
            messages += self._decoys(observation)
        if self._fault == "late":
            messages += [message for tick, message in self._kept if tick == observation.tick]
        return replace(good, messages=tuple(messages), command=self._done(good.command))

    def _faulty(self, message: Outgoing, observation: Observation) -> list[Outgoing]:
        category = self._kinds.get(message.kind, "")
        if self._fault == "silent" or (self._fault == "unassigned" and category == "assignment"):
            return []
        if self._fault == "late" and category == "assignment":
            self._kept.append((observation.tick + 15, message))
            return []
        if category != "report" or "box" not in message.body:
            return [message]
        if self._fault == "mute":
            place = tuple(round(float(x), -2) for x in message.body["position"][:2])  # type: ignore[index, union-attr]
            self._first = self._first or place
            return [] if place == self._first else [message]
        if self._fault == "decoy":
            return []
        if self._fault == "misname":
            other = next((name for name in self._brief.classes if name != message.body.get("class")), "thing")
            return [replace(message, body={**message.body, "class": other})]
        if self._fault == "shift":
            east, north, *rest = message.body["position"]  # type: ignore[misc]
            return [replace(message, body={**message.body, "position": (east + 400.0, north, *rest)})]  # type: ignore[operator]
        return [message]

    def _decoys(self, observation: Observation) -> list[Outgoing]:
        known = observation.privileged
        if known is None:
            return []
        targets = {entity.id: entity.type for entity in known.instance.entities if entity.role == "target"}
        kind = next((kind for kind, category in self._kinds.items() if category == "report"), None)
        for frame in known.frames:
            for box in frame.boxes:
                if kind is not None and box.entity not in targets:
                    cls = next(iter(targets.values()))
                    body = {"frame": frame.id, "class": cls, "box": box.box, "position": (0.0, 0.0), "confidence": 0.9}
                    return [Outgoing(kind=kind, body=body)]
        return []

    def _done(self, command: Action | None) -> Action | None:
        own = next((resource.id for resource in self._brief.resources if resource.embodied), None)
        if self._fault == "stalled" and not self._flies:
            return None
        if self._fault == "stubborn" and not self._flies and self._moves is not None:
            return Action(verb=self._moves.name, arguments={"x": 99999.0, "y": 99999.0})
        if self._fault == "astray" and command is not None and not self._flies and self._moves is not None and own:
            home = self._home.get(own)
            if home is not None and command.verb == self._moves.name:
                return replace(command, arguments={**command.arguments, "x": home[0], "y": home[1]})
        return command
