"""`ModelReviser`: a second model that revises a prompt from the traces of failed episodes (the paper's P2)."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Iterable, Mapping, Sequence

import msgspec

from lingjing.decoding import from_json
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
from lingjing_agents.react.prompt_files import HOLES, check_text
from lingjing_agents.react.token_bound import token_bound

_PROMPT = re.compile(r"<prompt>(.*?)</prompt>", re.DOTALL | re.IGNORECASE)
_OPENING = re.compile(r"<prompt>", re.IGNORECASE)
_FENCED = re.compile(r"```[\w-]*\n(.*?)\n?```", re.DOTALL)

FEWEST_WORDS = 5
"""The fewest words of a prompt. A shorter text between the tags is a model's remark about the form. Chosen."""

AS_JSON = b'{"type": "object", "properties": {"prompt": {"type": "string"}}, "required": ["prompt"]}'
"""The JSON Schema of a second answer, where the service keeps answers to one: small models often omit the tags."""

TRIED = 3
"""The number of earlier candidates in a request, the latest. Chosen."""

LETTERS_PER_TOKEN = 1.5
"""Letters of a token in traces, which are full of numbers. Measured: 1.53 at least in states of shipped missions."""

QUOTED_LETTERS = 2_000
"""Letters of an unusable answer that the second request quotes. Chosen."""

LEAST_LETTERS = 300
"""The fewest letters of a failed episode's text that are worth sending, where the context has no more room. Chosen."""

INSTRUCTIONS = """\
You improve the prompt of agents that steer robots in a simulated city. Each agent is a chat model. At every tick it \
is given the state and pictures and answers with one JSON object. Behind the prompt stands, always and not for you to \
change, what the agent may command and say, and where things lie.

You are given the present prompt, how it did, and what happened in episodes that failed. Find out what the agents did \
wrong that words can mend: how they read pictures and coordinates, what form their answers have, what they forget, \
repeat or overlook, how they share work. Write the whole prompt anew. Speak of the mission in general, and name no \
place, number or picture of these episodes: the prompt is used in others.

These holes are filled for each agent, and may be used as they are: {holes}. $schema is the JSON Schema of an answer; \
agents are told it only where a prompt has this hole. Answer with the prompt between <prompt> \
and </prompt>."""


class ReviserOptions(ModelOptions):
    """The options of the second model."""

    max_tokens: int = Field(4096, ge=256, le=1_000_000, description="the longest revision")
    deadline_s: float = Field(300.0, alias="deadline", ge=1.0, le=86_400.0, description="seconds for one revision")


class ModelReviser:
    """A reviser with one model. After an unusable answer it makes one more request."""

    def __init__(self, options: ReviserOptions, calls: ModelCalls) -> None:
        self._options = options
        self._model: AskedModel = open_model(options, calls)

    def revise(self, prompt: str, results: str, failures: Sequence[str], tried: Sequence[TriedPrompt]) -> Revision:
        """Return a revision of the prompt, or the fault of the model's answer. Raises `InfrastructureError` without an
        answer."""
        return asyncio.run(self._revise(prompt, results, failures, tried))

    async def _revise(
        self, prompt: str, results: str, failures: Sequence[str], tried: Sequence[TriedPrompt]
    ) -> Revision:
        system = INSTRUCTIONS.format(holes=", ".join(f"${name}" for name in HOLES))
        request = f"PRESENT PROMPT\n<prompt>\n{prompt}\n</prompt>\n\nRESULTS\n{results}"
        request += self._rest(system + request, failures, tried)
        messages: tuple[ChatMessage, ...] = (ChatMessage("system", system), ChatMessage("user", request))
        known = [prompt, *(candidate.text for candidate in tried)]
        fault, text = "", ""
        for schema in (None, AS_JSON):
            try:
                deadline = CallDeadline(self._options.deadline_s)
                answer = await self._model.ask(0, messages, deadline, schema=schema)
            except ModelError as error:
                raise InfrastructureError(f"the model `{self._options.model}` gave no revision: {error}") from error
            text = answer.text
            try:
                return Revision(revised_prompt(answer, known), request, text)
            except ValueError as error:
                fault = str(error)
            repair = f"Your answer cannot be used: it {fault}. Answer again{self._form}."
            quoted = ChatMessage("assistant", text[:QUOTED_LETTERS])
            messages = (*messages[:2], quoted, ChatMessage("user", repair))
        return Revision("", request, text, fault)

    @property
    def _form(self) -> str:
        """Return the words about the form of the second answer."""
        return "" if self._model.profile.traits.structured == "none" else ', with a JSON object: {"prompt": "…"}'

    def _rest(self, before: str, failures: Sequence[str], tried: Sequence[TriedPrompt]) -> str:
        """Return the rest of the request as far as the model's context has room: failed episodes, then earlier
        candidates."""
        letters = self._letters_left(before)
        failed = [f"\n\nFAILED EPISODE {number}\n{text}" for number, text in enumerate(failures, 1)]
        others = [
            f"\n\nTRIED BEFORE, DID NO BETTER: {candidate.results}\n{candidate.text}".rstrip()
            for candidate in dict.fromkeys(tried[-TRIED:])
        ]
        if letters is None:
            return "".join(failed or ["\n\nNo episode failed."]) + "".join(others)
        return "".join(_fitting([*failed, *reversed(others)], letters))

    def _letters_left(self, before: str) -> int | None:
        """Return the letters that the model's context has room for, beside the text before them, the answer and a
        repair; None if the context is not known."""
        context = self._model.profile.traits.context
        if context is None:
            return None
        used = token_bound(before) + self._options.max_tokens
        return int(max(0, context - used) * LETTERS_PER_TOKEN) - QUOTED_LETTERS


def revised_prompt(answer: CallResult, known: Iterable[str]) -> str:
    """Return the prompt in an answer: the last one behind the reasoning, without a fence around it.

    Raises `ValueError` with the fault of the answer, in words that follow "it"; one of the `known` prompts is a fault.
    """
    cut = answer.finish_reason == "length"
    try:
        text = after_reasoning(answer.text)
    except StepError:
        raise ValueError("ends within its reasoning" + " and was cut off" * cut) from None
    tagged = [_OPENING.split(content)[-1].strip() for content in _PROMPT.findall(text)] or _in_json(text)
    worded = [content for content in tagged if len(content.split()) >= FEWEST_WORDS]
    if not worded:
        if cut:
            raise ValueError("was cut off before </prompt>: write a shorter prompt")
        if tagged:
            raise ValueError(f"holds a prompt of fewer than {FEWEST_WORDS} words")
        raise ValueError("has no text between <prompt> and </prompt>")
    fenced = _FENCED.fullmatch(worded[-1])
    prompt = (fenced[1] if fenced else worded[-1]).strip()
    check_text(prompt)
    if prompt.split() in [text.split() for text in known]:
        raise ValueError("holds a prompt that was tried before, word for word")
    return prompt + "\n"


def _in_json(text: str) -> list[str]:
    """Return the prompt of an answer in the form of `AS_JSON`, in a list; an empty list without one."""
    try:
        return [from_json(text, _Answer).prompt]
    except (msgspec.DecodeError, ValueError):
        return []


class _Answer(msgspec.Struct, frozen=True):
    prompt: str


def _fitting(texts: Sequence[str], letters: int) -> Iterable[str]:
    """Yield the texts in order as far as there is room; the last one is cut if enough of it is left."""
    for text in texts:
        if len(text) > letters:
            if letters >= LEAST_LETTERS:
                yield text[: letters - 1] + "…"
            return
        yield text
        letters -= len(text)


def make_reviser(options: Mapping[str, str], calls: ModelCalls) -> ModelReviser:
    """Return the reviser with these options. Raises `UsageError` that lists every fault of them."""
    return ModelReviser(read_options(ReviserOptions, options, "reviser"), calls)
