"""`ReactPolicy`: the loop of `react`: one request a boundary, and further ones for crops, repairs and deliberation.

It gives up with `ReactError` before the kernel stops waiting (`deadline`, in seconds); the kernel then substitutes a
no-op and records the reason and the cost. A service that rejects every request of `PATIENCE` ticks in a row ends the
episode with `InfrastructureError`, because it is no failure of the model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import msgspec

from lingjing.plugins.backbone import ChatMessage, ModelError
from lingjing.plugins.calls import CallResult, ModelCalls
from lingjing.plugins.decisions import JsonSchema
from lingjing.plugins.policy import (
    REFERENCE,
    Action,
    Brief,
    Decision,
    Inbox,
    InfrastructureError,
    NoDecisionError,
    Observation,
    Picture,
    Policy,
    UnreadBox,
    Usage,
    UsageError,
)
from lingjing.plugins.scaffold import (
    AgentParts,
    Crop,
    MemoryLimits,
    ModelStep,
    ScaffoldContext,
    Situation,
    StepError,
    Turn,
)
from lingjing_agents.heuristic.policy import HeuristicPolicy
from lingjing_agents.llm.asking import AskedModel, open_model
from lingjing_agents.llm.options import ModelProfile
from lingjing_agents.llm.retry import CallDeadline
from lingjing_agents.react.ablation import shown_brief, shown_observation
from lingjing_agents.react.answer import StepParser, after_reasoning
from lingjing_agents.react.facts import compact, interface, phrases_of
from lingjing_agents.react.history import TurnMemory
from lingjing_agents.react.options import ReactOptions
from lingjing_agents.react.own_counts import OwnCounts, OwnOrders
from lingjing_agents.react.pictures import image, images
from lingjing_agents.react.prompt import ReactPrompt
from lingjing_agents.react.prompt_files import prompt_text
from lingjing_agents.react.remedy import explained, remedy
from lingjing_agents.react.request_budget import RequestBudget, picture_sizes
from lingjing_agents.react.route_guidance import RouteGuidance
from lingjing_agents.react.search_budget import SearchBudget
from lingjing_agents.react.step import StepFormat
from lingjing_agents.react.token_bound import message_bound
from lingjing_agents.sweep import SweepPolicy

PATIENCE = 3
"""Ticks in a row without an answer of an agent's service, each with its own tries, that end the episode. Chosen."""

DECISION_SHARE = 0.9
"""The share of the kernel's wait for a decision after which the policy gives up, so that it can name the cause.
Chosen."""

LONGEST_SIDE = 4096
"""The longer side of a sent picture at most, pixels, where neither option nor model has a bound. Chosen."""

LEAST_SHARE = 0.7
"""Tokens of a text for each token of its bound, at least. Measured: 0.73 (`react.call_profile`)."""

CROP_SIDE = 768
"""The longer side of a crop at least, pixels; a smaller crop is enlarged. Chosen."""


class ReactError(NoDecisionError):
    """The error of a tick without a decision; the text states the reason."""


def react_policy(options: ReactOptions, calls: ModelCalls) -> Policy:
    """Return the policy of the options: the model's, or a policy without a model in its place."""
    if options.decider == "sweep":
        return SweepPolicy()
    return HeuristicPolicy() if options.decider == "heuristic" else ReactPolicy(options, calls)


class ReactPolicy:
    """The policy of one agent over a chat model."""

    def __init__(self, options: ReactOptions, calls: ModelCalls) -> None:
        self._options = options
        self._scaffold = options.scaffold_builder()
        self._model = open_model(options, calls)
        self._side = options.image_side or self._model.profile.traits.image_side or LONGEST_SIDE
        self._prompt = prompt_text(options.prompt)
        self._budget = _budget(options, self._model.profile)
        self._refused = 0
        self._answers, self._valid = 0, 0
        self._unread: tuple[UnreadBox, ...] = ()

    async def reset(self, brief: Brief) -> None:
        """Begin an episode. The system text is written at the first boundary, because it needs the observation."""
        self._guidance = RouteGuidance(brief, self._options.intervention)
        self._brief = shown_brief(self._guidance.brief(brief), self._options)
        self._prompt = prompt_text(self._options.prompt, brief.language)
        self._refused = 0
        self._answers, self._valid = 0, 0
        self._unread = ()
        self._system: ChatMessage | None = None
        self._references: tuple[Picture, ...] = ()
        self._withheld = ""
        self._commands: dict[int, Action] = {}
        self._parts = self._scaffold(ScaffoldContext(self._brief, self._own_parts()))
        schema = self._parts.parser.schema
        self._schema = msgspec.json.encode(schema) if self._structured and schema is not None else None
        self._counts, self._orders = OwnCounts(self._brief), OwnOrders(self._brief)
        self._search = SearchBudget(self._brief, self._options.research)
        self._check_context()

    def _check_context(self) -> None:
        """Raise `UsageError` if the model's context is shorter than the system text that begins every request."""
        context = self._model.profile.traits.context
        parts = self._parts
        text = "\n".join(
            (
                self._prompt.filled(self._brief, parts.parser.instructions),
                interface(self._brief),
                parts.memory.instructions,
            )
        )
        least = round(LEAST_SHARE * message_bound(text))
        if context is not None and context < least:
            raise UsageError(
                f"`{self._options.model}` has a context of {context:,} tokens, and the first request of "
                f"`{self._brief.agent}` has at least {least:,}, without its state, pictures and answer",
                hint="serve it with a longer context and set `context` in the list of models, or choose another",
            )

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the step of the model's answer, after its crops and repairs.

        Raises `ReactError` without a valid step in time, and `InfrastructureError` if the service answers nothing.
        """
        observation = self._guidance.observation(shown_observation(observation, self._brief, self._options))
        self._references += tuple(picture for picture in observation.pictures if picture.camera == REFERENCE)
        self._counts.receive(inbox)
        self._orders.receive(inbox)
        if self._idle(observation, inbox):
            return Decision(thought="the search is over and nothing is new: the model was not asked")
        pictures = self._shown(observation)
        sent = tuple(file for picture in pictures for file in images(picture, self._side, self._options.tiles))
        situation = Situation(observation, inbox, pictures, sent, dict(self._commands), self._members(observation))
        if self._system is None:
            self._system = ChatMessage("system", self._system_text(observation))
            room = self._history_tokens(self._parts.prompt.state(situation))
            self._parts.memory.begin(MemoryLimits(room, self._history_images()))
        try:
            return await self._decide(situation, CallDeadline(self._patience_s()))
        except ModelError as error:
            raise self._failure(error, tuple(file.jpeg for file in sent)) from error

    async def _decide(self, situation: Situation, deadline: CallDeadline) -> Decision:
        """Deliberate, request the step, and record the turn."""
        assert self._system is not None
        parts, tick = self._parts, situation.observation.tick
        thoughts = await parts.deliberation.think(situation, _Question(self._model, tick, deadline, self._structured))
        situation = replace(situation, members={**thoughts, **situation.members})
        text = parts.prompt.state(situation)
        question = ChatMessage("user", text, tuple(file.jpeg for file in situation.images))
        request = self._budget.fitted(self._system, parts.memory.turns(), question)
        step, answer = await self._settle(tick, request, situation.pictures, deadline)
        decision = self._sendable(step.decision, situation.observation)
        self._counts.send(decision, tick)
        self._orders.send(decision, tick)
        parts.memory.record(Turn(tick, text, answer, step, decision, situation.images))
        return msgspec.structs.replace(decision, usage=self._bill())

    def _own_parts(self) -> AgentParts:
        """Return the parts of `react` for the brief."""
        options = self._options
        form = StepFormat(self._brief, memory=options.memory, crops=options.crops > 0)
        self._own_parser = StepParser(form, in_text=self._prompt.has_schema, say=phrases_of(self._brief))
        return AgentParts(
            ReactPrompt(self._prompt, self._brief, crops=options.crops, route=self._guidance.section()),
            TurnMemory(keeps_lines=options.memory, pictures=self._budget.pictures, say=phrases_of(self._brief)),
            self._own_parser,
        )

    @property
    def _structured(self) -> bool:
        """True if the service keeps answers to a schema."""
        return self._model.profile.traits.structured in ("json_schema", "tool")

    def _system_text(self, observation: Observation) -> str:
        parts = self._parts
        return parts.prompt.system(observation, parts.memory.instructions, parts.parser.instructions)

    def _history_tokens(self, first: str) -> int:
        """Return the tokens of earlier turns: what the budget leaves beside states like the first one, or less if the
        option has a bound."""
        assert self._system is not None
        sizes = [
            size
            for size in picture_sizes(self._brief, self._most_pictures(), self._side)
            for _ in range(self._images_each())
        ]
        room = self._budget.room(self._system, first, sizes)
        most = self._options.history_tokens
        return room if most is None else min(most, room)

    def _members(self, observation: Observation) -> Mapping[str, object]:
        """Return the members of the state that the loop adds: memory, withheld command, rest of the search, counts,
        orders."""
        memory = self._parts.memory.members()
        own = {**self._search.members(observation), **self._counts.members(), **self._orders.members(observation)}
        return {**memory, "withheld": self._withheld, **own, "next_node": self._guidance.next_node()}

    def _idle(self, observation: Observation, inbox: Inbox) -> bool:
        """Return True if the search is over and nothing is new."""
        news = inbox.messages or observation.events or observation.pictures or inbox.receipts
        return self._search.over(observation) and not news

    def _shown(self, observation: Observation) -> tuple[Picture, ...]:
        """Return the pictures of the request: the reference pictures, at every boundary, then the newest ones."""
        if not self._model.profile.traits.images:
            return ()
        new = tuple(picture for picture in observation.pictures if picture.camera != REFERENCE)
        return (*self._references, *new)[: self._most_pictures()]

    def _most_pictures(self) -> int:
        """Return the number of pictures of one boundary: the option, or less where the service takes fewer images."""
        most = self._model.profile.traits.most_images
        return self._options.images if most is None else min(self._options.images, most // self._images_each())

    def _history_images(self) -> int:
        """Return the number of images of earlier turns: the option, or less where the service takes fewer images beside
        those of a boundary and its crops."""
        most, options = self._model.profile.traits.most_images, self._options
        if most is None:
            return options.history_images
        left = most - self._most_pictures() * self._images_each() - options.crops
        return max(0, min(options.history_images, left))

    def _images_each(self) -> int:
        """Return the number of images of one picture: the whole and its tiles."""
        return 1 if self._options.tiles == 1 else 1 + self._options.tiles**2

    def _sendable(self, decision: Decision, observation: Observation) -> Decision:
        """Return the decision with the command that may be given. The kernel admits it at the next boundary."""
        decision = msgspec.structs.replace(decision, command=self._guidance.command(decision.command))
        self._withheld = self._search.withheld(decision.command, observation)
        if self._withheld:
            decision = msgspec.structs.replace(decision, command=None)
        if decision.command is not None:
            self._commands[observation.tick + 1] = decision.command
        return decision

    def _failure(self, error: ModelError, shown: tuple[bytes, ...]) -> ReactError | InfrastructureError:
        """Return the error of a failed call. Slow answers and refused topics are failures of the model; a service that
        answers nothing is not."""
        if error.fault != "time":
            self._refused = self._refused + 1 if error.fault in ("service", "backbone") else 0
        if self._refused < PATIENCE:
            return ReactError(explained(error, shown, self._schema), self._bill())
        if error.fault == "backbone":
            return InfrastructureError(
                f"`{self._brief.agent}` got no answer {self._refused} ticks in a row: {error}",
                hint="correct the backbone: `pytest` on its package runs the conformance kit",
            )
        return InfrastructureError(
            f"the model service refused `{self._brief.agent}` {self._refused} ticks in a row, at last with: {error}",
            hint=remedy(error, shown, self._schema) or "see that the service runs and answers, then run it again",
        )

    def _patience_s(self) -> float:
        """Return the seconds of one decision: those of the options, and less than the kernel waits."""
        limit_s, own_s = self._brief.decision_s, self._options.deadline_s
        return own_s if limit_s is None else min(own_s, DECISION_SHARE * limit_s)

    async def _settle(
        self, tick: int, messages: tuple[ChatMessage, ...], pictures: Sequence[Picture], deadline: CallDeadline
    ) -> tuple[ModelStep, str]:
        """Return the final step and its answer, after crops and repairs."""
        repairs, crops, fault = self._options.repairs, self._options.crops, ""
        while True:
            completion = await self._model.ask(tick, messages, deadline, schema=self._schema)
            self._refused = 0
            answer = answered(completion.text)
            try:
                step = self._read(completion)
                if step.crop is None:
                    return step, answer
                reply, crops = self._cropped(step.crop, pictures, crops), crops - 1
            except StepError as error:
                fault = str(error)
                if repairs == 0:
                    break
                repairs -= 1
                reply = ChatMessage("user", self._parts.parser.repair(fault))
            messages = (*messages, ChatMessage("assistant", answer[:2000] or "(nothing)"), reply)
        tried = f"{self._options.repairs} repair{'s' * (self._options.repairs != 1)}"
        raise ReactError(f"no valid step after {tried}; last fault: {fault}", self._bill())

    def _read(self, completion: CallResult) -> ModelStep:
        """Return the step of an answer. Counts the answers, and those that satisfy the schema."""
        self._answers += 1
        if completion.finish_reason == "length":
            raise StepError(f"it was cut off at {self._options.max_tokens} tokens; be much shorter")
        if completion.finish_reason == "content_filter":
            raise StepError("the service's content filter removed it")
        try:
            step = self._parts.parser.parse(completion.text)
        except StepError:
            self._unread += self._own_parser.unread_boxes(completion.text)
            raise
        self._valid += 1
        return step

    def _cropped(self, crop: Crop, pictures: Sequence[Picture], left: int) -> ChatMessage:
        """Return the message with a part of a picture, enlarged. Raises `StepError` for a picture that was not sent and
        for one crop too many."""
        if left == 0:
            raise StepError("no crop is left at this tick: decide now")
        picture = next((sent for sent in pictures if sent.frame == crop.frame), None)
        if picture is None:
            known = ", ".join(sent.frame for sent in pictures) or "none at this tick"
            raise StepError(f"crop.frame: `{crop.frame}` is none of the pictures that you have: {known}")
        cut = image(picture, crop.box, self._side, least_side=CROP_SIDE)
        caption = {"crop_of": crop.frame, "shows": [round(edge, 4) for edge in cut.part], "crops_left": left - 1}
        note = phrases_of(self._brief)("Boxes stay those of the whole picture.")
        return ChatMessage("user", f"{compact(caption)} {note}", (cut.jpeg,))

    def _bill(self) -> Usage:
        """Return the cost since the last bill, with the numbers of answers and of valid answers."""
        bill = msgspec.structs.replace(
            self._model.bill(), answers=self._answers, valid_answers=self._valid, unread_boxes=self._unread
        )
        self._answers, self._valid, self._unread = 0, 0, ()
        return bill


def _budget(options: ReactOptions, profile: ModelProfile) -> RequestBudget:
    """Return the budget of the options, or the model's context if that is smaller."""
    tokens = min(options.request_tokens, profile.traits.context or options.request_tokens)
    return RequestBudget(tokens, options.max_tokens, profile.counted)


class _Question:
    """A request of a deliberation (`lingjing.plugins.scaffold.ModelQuestion`)."""

    def __init__(self, model: AskedModel, tick: int, deadline: CallDeadline, structured: bool) -> None:
        self._model, self._tick, self._deadline, self._structured = model, tick, deadline, structured

    async def __call__(self, messages: Sequence[ChatMessage], schema: JsonSchema | None = None) -> str:
        """Return the answer's text without its reasoning."""
        form = msgspec.json.encode(schema) if schema is not None and self._structured else None
        completion = await self._model.ask(self._tick, tuple(messages), self._deadline, schema=form)
        return answered(completion.text)


def answered(text: str) -> str:
    """Return an answer without its reasoning; "" if the reasoning does not end."""
    try:
        return after_reasoning(text)
    except StepError:
        return ""
