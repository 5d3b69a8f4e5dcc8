"""`RequestPlayer`: the answers to the requests of one agent, from the requests alone."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Coroutine, Mapping
from dataclasses import dataclass
from typing import Any

from lingjing.plugins.policy import Brief, Decision
from lingjing_agents.heuristic.policy import HeuristicPolicy
from lingjing_agents.heuristic.target_types import Detectors
from lingjing_agents.reader.request_text import agent_in, brief_from, inbox_from, observation_from

Request = Mapping[str, Any]
"""The JSON body of a request of the OpenAI chat protocol."""

DetectorsOf = Callable[[Brief], Detectors]
"""A function of the brief that returns the detectors of a player."""


@dataclass(frozen=True, slots=True)
class _Mind:
    """The rules of one agent."""

    brief: Brief
    policy: HeuristicPolicy


class RequestPlayer:
    """The player of the agents that send requests to one service, each with rules of its own."""

    def __init__(self, detectors_of: DetectorsOf = lambda brief: {}) -> None:
        self._detectors_of = detectors_of
        self._minds: dict[str, _Mind] = {}

    def answer(self, request: Request) -> str:
        """Return the answer to a request, a JSON object as text.

        Raises `ValueError` or `KeyError` for a request of another form than that of `react`.
        """
        turns = request["messages"]
        system = turns[0]["content"]
        mind = self._minds.get(agent_in(system)) or self._begun(system)
        state, images = _newest_state(turns)
        observation = observation_from(state, images, mind.brief)
        decision: Decision = _result(mind.policy.act(observation, inbox_from(state, mind.brief)))
        return json.dumps(_in_json(decision))

    def _begun(self, system: str) -> _Mind:
        """Return the rules of an agent at its first request."""
        brief = brief_from(system)
        mind = _Mind(brief, HeuristicPolicy(self._detectors_of(brief)))
        _result(mind.policy.reset(brief))
        self._minds[brief.agent] = mind
        return mind


def _newest_state(turns: list[dict[str, Any]]) -> tuple[dict[str, Any], list[bytes]]:
    """Return the state and the images of the last message."""
    content = turns[-1]["content"]
    if isinstance(content, str):
        return json.loads(content), []
    urls = [part["image_url"]["url"] for part in content if part["type"] == "image_url"]
    text = next(part["text"] for part in content if part["type"] == "text")
    return json.loads(text), [base64.b64decode(url.split(",", 1)[1]) for url in urls]


def _in_json(decision: Decision) -> dict[str, Any]:
    command = decision.command
    return {
        "thought": decision.thought,
        "command": None
        if command is None
        else {"resource": command.resource, "verb": command.verb, "arguments": dict(command.arguments)},
        "messages": [
            {"kind": message.kind, "body": dict(message.body), "to": list(message.to)} for message in decision.messages
        ],
    }


def _result(coroutine: Coroutine[Any, Any, Any]) -> Any:
    """Return the result of a coroutine that never waits."""
    try:
        coroutine.send(None)
    except StopIteration as end:
        return end.value
    raise RuntimeError("the heuristic waits for something")
