"""`plan-manage-act`: a planner writes the steps, a manager follows them, and the actor decides.

At its first boundary, then every `every` boundaries or when the manager asks for it, the planner writes a plan. At the
boundaries between, the manager chooses the step that is due. The plan and the step are members of the state that the
actor (the usual request of `react`) receives. A planner or manager whose answer cannot be read changes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from lingjing.plugins.backbone import ChatMessage
from lingjing.plugins.decisions import JsonSchema
from lingjing.plugins.options import Field, PluginOptions
from lingjing.plugins.policy import Brief, Observation
from lingjing.plugins.scaffold import AgentParts, ModelQuestion, PromptBuilder, ScaffoldContext, Situation
from lingjing_agents.scaffolds.json_objects import first_object, lines, plain

STEPS, LETTERS = 8, 160
"""Bounds of a plan: steps, and letters of each. Chosen: they fit the state beside its other members."""

PLANNER = """\
You plan for the agent `{agent}` ({role}). The goal of its mission: {goal}
From the state below write the steps that the agent should take from now on, in order. Each step is one sentence: what \
to do, and how to see that it is done. At most {steps} steps. Answer with one JSON object: {{"steps": [text, …]}}"""

MANAGER = """\
You manage the agent `{agent}` ({role}). Below are its plan and its state. Choose the step that it should work at now, \
and say if the plan no longer fits. Answer with one JSON object: {{"step": number of the step from 1, "order": one \
sentence for the agent, "replan": true or false}}"""

ACTOR = """\
YOUR PLAN
The state may have "plan" (the steps that were planned for you), "step" (the one that is due) and "order" (what to do \
now). Follow the order where the state allows it; the rules and your own eyes count more than the plan."""

_PLAN: JsonSchema = {
    "type": "object",
    "properties": {"steps": {"type": "array", "items": {"type": "string"}}},
    "required": ["steps"],
}
_ORDER: JsonSchema = {
    "type": "object",
    "properties": {"step": {"type": "integer"}, "order": {"type": "string"}, "replan": {"type": "boolean"}},
    "required": ["step", "order", "replan"],
}


class PlanOptions(PluginOptions):
    """The options of the scaffold."""

    every: int = Field(10, ge=1, le=10_000, description="boundaries after which the plan is written anew")


@dataclass(frozen=True, slots=True)
class PlanPrompt:
    """The prompt of `react` with a section that explains the plan."""

    react: PromptBuilder

    def system(self, first: Observation, memory: str, answer: str) -> str:
        """Return the system text of `react`, and the section."""
        return f"{self.react.system(first, memory, answer)}\n\n{ACTOR}"

    def state(self, situation: Situation) -> str:
        """Return the state as `react` writes it."""
        return self.react.state(situation)


class PlanAndManage:
    """The planner and the manager of one agent."""

    def __init__(self, brief: Brief, prompt: PromptBuilder, every: int) -> None:
        self._names = {"agent": brief.agent, "role": brief.role, "goal": brief.goal, "steps": STEPS}
        self._prompt = prompt
        self._every = every
        self._plan: tuple[str, ...] = ()
        self._planned_at = 0
        self._step, self._order = 0, ""

    async def think(self, situation: Situation, ask: ModelQuestion) -> Mapping[str, object]:
        """Return the plan, the step that is due and the order."""
        tick = situation.observation.tick
        state = self._prompt.state(situation)
        due = not self._plan or tick - self._planned_at >= self._every
        if due or await self._manage(state, ask):
            await self._write_plan(state, tick, ask)
        return {"plan": self._plan, "step": self._step + 1 if self._plan else None, "order": self._order}

    async def _write_plan(self, state: str, tick: int, ask: ModelQuestion) -> None:
        answer = await ask(_question(PLANNER.format(**self._names), state), _PLAN)
        steps = lines(first_object(answer).get("steps"), STEPS, LETTERS)
        if steps:
            self._plan, self._planned_at, self._step, self._order = steps, tick, 0, ""

    async def _manage(self, state: str, ask: ModelQuestion) -> bool:
        """Choose the step that is due. Returns True if the plan no longer fits."""
        plan = "\n".join(f"{number}. {step}" for number, step in enumerate(self._plan, 1))
        answer = first_object(await ask(_question(MANAGER.format(**self._names), f"PLAN\n{plan}\n\n{state}"), _ORDER))
        step, order = answer.get("step"), answer.get("order")
        if isinstance(step, int) and 1 <= step <= len(self._plan):
            self._step = step - 1
        if isinstance(order, str):
            self._order = plain(order, LETTERS)
        return answer.get("replan") is True


def plan_manage_act(context: ScaffoldContext, options: PlanOptions) -> AgentParts:
    """Return the parts of `react` with the plan's section and the two further requests."""
    prompt = context.react.prompt
    return replace(
        context.react,
        prompt=PlanPrompt(prompt),
        deliberation=PlanAndManage(context.brief, prompt, options.every),
    )


def _question(system: str, user: str) -> tuple[ChatMessage, ...]:
    return (ChatMessage("system", system), ChatMessage("user", user))
