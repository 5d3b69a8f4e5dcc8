"""`reflective-memory`: the agent writes a lesson after each boundary with a failed request, and keeps the latest ones.

A request fails if the kernel or an engine rejects it, or if the kernel substitutes the agent's decision. The model is
then asked what to do differently. The lessons are a member of the state at every later boundary.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace

from lingjing.plugins.backbone import ChatMessage
from lingjing.plugins.options import Field, PluginOptions
from lingjing.plugins.policy import Brief, Receipt
from lingjing.plugins.scaffold import (
    AgentParts,
    Memory,
    MemoryLimits,
    ModelQuestion,
    ScaffoldContext,
    Situation,
    Turn,
)
from lingjing_agents.scaffolds.json_objects import plain

LETTERS = 240
"""Letters of a lesson. Chosen: two sentences."""

FAILED = ("rejected", "substituted")
"""The statuses of receipts that a lesson is written about."""

REFLECT = """\
You are `{agent}` ({role}). The goal of your mission: {goal}
Something that you did has failed. Below are your last answer and what became of it. Say in one or two sentences what \
you will do differently from now on. Answer with these sentences alone."""

INSTRUCTIONS = """\
YOUR LESSONS
The state may have "lessons": what you wrote after things that failed, the latest last. Do not make the same mistake \
again."""


class LessonOptions(PluginOptions):
    """The options of the scaffold."""

    lessons: int = Field(6, ge=1, le=50, description="lessons that are kept, the latest")


class ReflectiveMemory:
    """The memory of `react` with lessons, and the deliberation that writes them."""

    def __init__(self, brief: Brief, react: Memory, most: int) -> None:
        self._agent = brief.agent
        self._system = REFLECT.format(agent=brief.agent, role=brief.role, goal=brief.goal)
        self._react = react
        self._most = most
        self._lessons: tuple[str, ...] = ()
        self._last: Turn | None = None

    @property
    def instructions(self) -> str:
        """The instructions of `react`'s memory, then those of the lessons."""
        return "\n\n".join(text for text in (self._react.instructions, INSTRUCTIONS) if text)

    def begin(self, limits: MemoryLimits) -> None:
        """Begin the memory of `react`."""
        self._react.begin(limits)

    def turns(self) -> tuple[ChatMessage, ...]:
        """Return the turns of `react`'s memory."""
        return self._react.turns()

    def record(self, turn: Turn) -> None:
        """Keep the turn; a lesson quotes the last one."""
        self._react.record(turn)
        self._last = turn

    async def think(self, situation: Situation, ask: ModelQuestion) -> Mapping[str, object]:
        """Write a lesson if a request failed. Returns the lessons."""
        failed = [receipt for receipt in situation.inbox.receipts if self._is_own_failure(receipt)]
        if failed:
            outcome = [
                {"status": receipt.status, "reason": receipt.reason, "detail": receipt.detail} for receipt in failed
            ]
            last = self._last.answer if self._last is not None else "(nothing)"
            user = f"YOUR LAST ANSWER\n{last}\n\nWHAT BECAME OF IT\n{json.dumps(outcome)}"
            answer = await ask((ChatMessage("system", self._system), ChatMessage("user", user)))
            self._learn(plain(answer, LETTERS))
        return {"lessons": self._lessons}

    def members(self) -> Mapping[str, object]:
        """Return the members of `react`'s memory."""
        return self._react.members()

    def _learn(self, lesson: str) -> None:
        """Keep a lesson as the latest; one that is known moves to the end."""
        if lesson:
            known = [other for other in self._lessons if other != lesson]
            self._lessons = tuple([*known, lesson][-self._most :])

    def _is_own_failure(self, receipt: Receipt) -> bool:
        return receipt.sender == self._agent and receipt.status in FAILED


def reflective_memory(context: ScaffoldContext, options: LessonOptions) -> AgentParts:
    """Return the parts of `react` with a memory that learns from failures."""
    memory = ReflectiveMemory(context.brief, context.react.memory, options.lessons)
    return replace(context.react, memory=memory, deliberation=memory)
