"""`ModelReviser`: a second model that revises a prompt from the traces of failed episodes (the paper's P2)."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Iterable, Mapping, Sequence

import msgspec

from lingjing.plugins.backbone import ChatMessage, ModelError
from lingjing.plugins.calls import CallResult, ModelCalls
from lingjing.plugins.options import Field, read_options
from lingjing.plugins.policy import InfrastructureError
from lingjing.plugins.prompts import Revision, TriedPrompt
from lingjing.plugins.scaffold import StepError
from lingjing_agents.llm.asking import AskedModel, open_model
from lingjing_agents.llm.options import ModelOptions
from lingjing_agents.llm.retry import CallDeadline
from lingjing_agents.react.answer import after_reasoning
from lingjing_agents.react.history import LETTERS_PER_TOKEN, text_tokens
from lingjing_agents.react.prompt_files import HOLES, check_text

_PROMPT = re.compile(r"<prompt>(.*?)</prompt>", re.DOTALL | re.IGNORECASE)
_OPENING = re.compile(r"<prompt>", re.IGNORECASE)
_FENCED = re.compile(r"```[\w-]*\n(.*?)\n?```", re.DOTALL)

FEWEST_WORDS = 5
"""What has fewer is no prompt but what a model says of the form: `between <prompt> and </prompt>`."""

AS_JSON = b'{"type": "object", "properties": {"prompt": {"type": "string"}}, "required": ["prompt"]}'
"""The form of a second answer, where the service keeps answers to a form: a small model is poor at tags of its own."""

TRIED = 3
"""Earlier candidates that a reviser is shown, the latest."""

QUOTED_LETTERS = 2_000
"""How much of an answer that cannot be used is shown to its model again."""

LEAST_LETTERS = 300
"""What is left of a failed episode's text where a model's context takes no more; with less it is left out."""

INSTRUCTIONS = """\
You improve the prompt of agents that steer robots in a simulated city. Each agent is a chat model. At every tick it \
is given the state and pictures and answers with one JSON object. Behind the prompt stands, always and not for you to \
change, what the agent may command and say, and where things lie.

You are given the present prompt, how it did, and what happened in episodes that failed. Find out what the agents did \
wrong that words can mend: how they read pictures and coordinates, what form their answers have, what they forget, \
repeat or overlook, how they share work. Write the whole prompt anew. Speak of the mission in general, and name no \
place, number or picture of these episodes: the prompt is used in others.

These holes are filled for each agent, and may be used as they are: {holes}. Answer with the prompt between <prompt> \
and </prompt>."""


class ReviserOptions(ModelOptions):
    """What the second model can be told."""

    max_tokens: int = Field(4096, ge=256, le=1_000_000, description="the longest revision")
    deadline_s: float = Field(300.0, alias="deadline", ge=1.0, le=86_400.0, description="seconds for one revision")


class ModelReviser:
    """Asks one model for revisions; an answer that cannot be used is asked for once more."""

    def __init__(self, options: ReviserOptions, calls: ModelCalls) -> None:
        self._options = options
        self._model: AskedModel = open_model(options, calls)

    def revise(self, prompt: str, results: str, failures: Sequence[str], tried: Sequence[TriedPrompt]) -> Revision:
        """A revision of the prompt, or what is wrong with the model's answer. Raises `InfrastructureError` if it gives
        none."""
        return asyncio.run(self._revise(prompt, results, failures, tried))

    async def _revise(
        self, prompt: str, results: str, failures: Sequence[str], tried: Sequence[TriedPrompt]
    ) -> Revision:
        system = INSTRUCTIONS.format(holes=", ".join(f"${name}" for name in HOLES))
        asked = f"PRESENT PROMPT\n<prompt>\n{prompt}\n</prompt>\n\nRESULTS\n{results}"
        asked += self._rest(system + asked, failures, tried)
        messages: tuple[ChatMessage, ...] = (ChatMessage("system", system), ChatMessage("user", asked))
        known = [prompt, *(one.text for one in tried)]
        fault, answered = "", ""
        for schema in (None, AS_JSON):
            try:
                deadline = CallDeadline(self._options.deadline_s)
                answer = await self._model.ask(0, messages, deadline, schema=schema)
            except ModelError as error:
                raise InfrastructureError(f"the model `{self._options.model}` gave no revision: {error}") from error
            answered = answer.text
            try:
                return Revision(revised_prompt(answer, known), asked, answered)
            except ValueError as error:
                fault = str(error)
            said = f"Your answer cannot be used: it {fault}. Answer again{self._form}."
            quoted = ChatMessage("assistant", answered[:QUOTED_LETTERS])
            messages = (*messages[:2], quoted, ChatMessage("user", said))
        return Revision("", asked, answered, fault)

    @property
    def _form(self) -> str:
        """What a model is told of the form of its second answer."""
        return "" if self._model.profile.traits.structured == "none" else ', with a JSON object: {"prompt": "…"}'

    def _rest(self, before: str, failures: Sequence[str], tried: Sequence[TriedPrompt]) -> str:
        """What else the model is told, as far as its context takes it: what failed, then what was tried."""
        letters = self._letters_left(before)
        failed = [f"\n\nFAILED EPISODE {number}\n{text}" for number, text in enumerate(failures, 1)]
        others = [
            f"\n\nTRIED BEFORE, DID NO BETTER: {one.results}\n{one.text}".rstrip()
            for one in dict.fromkeys(tried[-TRIED:])
        ]
        if letters is None:
            return "".join(failed or ["\n\nNo episode failed."]) + "".join(others)
        return "".join(_fitting([*failed, *reversed(others)], letters))

    def _letters_left(self, before: str) -> int | None:
        """Letters that the model's context takes beside what it is told before them, what it answers and what is said
        of an answer that cannot be used; None if the context is not known."""
        context = self._model.profile.traits.context
        if context is None:
            return None
        used = text_tokens(before) + self._options.max_tokens
        return int(max(0, context - used) * LETTERS_PER_TOKEN) - QUOTED_LETTERS


def revised_prompt(answer: CallResult, known: Iterable[str]) -> str:
    """The prompt in an answer: the last one behind the reasoning, without a fence around it. Raises `ValueError` that
    says what is wrong with the answer, in words that follow "it"; one of the `known` prompts is wrong too."""
    cut = answer.finish_reason == "length"
    try:
        text = after_reasoning(answer.text)
    except StepError:
        raise ValueError("ends within its reasoning" + " and was cut off" * cut) from None
    found = [_OPENING.split(one)[-1].strip() for one in _PROMPT.findall(text)] or _in_json(text)
    worded = [one for one in found if len(one.split()) >= FEWEST_WORDS]
    if not worded:
        if cut:
            raise ValueError("was cut off before </prompt>: write a shorter prompt")
        if found:
            raise ValueError(f"holds a prompt of fewer than {FEWEST_WORDS} words")
        raise ValueError("has no text between <prompt> and </prompt>")
    fenced = _FENCED.fullmatch(worded[-1])
    prompt = (fenced[1] if fenced else worded[-1]).strip()
    check_text(prompt)
    if prompt.split() in [one.split() for one in known]:
        raise ValueError("holds a prompt that was tried before, word for word")
    return prompt + "\n"


def _in_json(text: str) -> list[str]:
    """The prompt of an answer in the form of `AS_JSON`."""
    try:
        return [msgspec.json.decode(text, type=_Answer).prompt]
    except (msgspec.DecodeError, ValueError):
        return []


class _Answer(msgspec.Struct, frozen=True):
    prompt: str


def _fitting(texts: Sequence[str], letters: int) -> Iterable[str]:
    """The texts in order, as many as there is room for, the last one cut if enough of it is left."""
    for text in texts:
        if len(text) > letters:
            if letters >= LEAST_LETTERS:
                yield text[: letters - 1] + "…"
            return
        yield text
        letters -= len(text)


def make_reviser(given: Mapping[str, str], calls: ModelCalls) -> ModelReviser:
    """The reviser of the given options. Raises `UsageError` that tells every fault of them."""
    return ModelReviser(read_options(ReviserOptions, given, "reviser"), calls)
