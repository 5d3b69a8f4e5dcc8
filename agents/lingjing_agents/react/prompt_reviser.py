"""`ModelReviser`: a second model that revises a prompt from the traces of failed episodes (the paper's P2)."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Mapping, Sequence

from lingjing.plugins.calls import ModelCalls
from lingjing.plugins.options import Field, read_options
from lingjing.plugins.policy import InfrastructureError
from lingjing.plugins.prompts import Revision
from lingjing_agents.llm.asking import AskedModel, open_model
from lingjing_agents.llm.chat import ChatMessage, ModelError
from lingjing_agents.llm.options import ModelOptions
from lingjing_agents.llm.retry import CallDeadline
from lingjing_agents.react.prompt_files import HOLES, check_text

_PROMPT = re.compile(r"<prompt>\n?(.*?)\n?</prompt>", re.DOTALL)

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
    """Asks one model for revisions; an answer that holds no prompt is asked for once more."""

    def __init__(self, options: ReviserOptions, calls: ModelCalls) -> None:
        self._options = options
        self._model: AskedModel = open_model(options, calls)

    def revise(self, prompt: str, results: str, failures: Sequence[str]) -> Revision:
        """A revision of the prompt. Raises `InfrastructureError` if the model gives none."""
        return asyncio.run(self._revise(prompt, results, failures))

    async def _revise(self, prompt: str, results: str, failures: Sequence[str]) -> Revision:
        holes = ", ".join(f"${name}" for name in HOLES)
        told = "\n\n".join(f"FAILED EPISODE {number}\n{text}" for number, text in enumerate(failures, 1))
        asked = f"PRESENT PROMPT\n<prompt>\n{prompt}\n</prompt>\n\nRESULTS\n{results}\n\n{told or 'No episode failed.'}"
        messages: tuple[ChatMessage, ...] = (
            ChatMessage("system", INSTRUCTIONS.format(holes=holes)),
            ChatMessage("user", asked),
        )
        fault = ""
        for _ in range(2):
            try:
                answer = await self._model.ask(0, messages, CallDeadline(self._options.deadline_s))
            except ModelError as error:
                raise InfrastructureError(f"the model `{self._options.model}` gave no revision: {error}") from error
            found = _PROMPT.findall(answer.text)
            try:
                if not found:
                    raise ValueError("has no text between <prompt> and </prompt>")
                check_text(found[-1])
            except ValueError as error:
                fault = str(error)
                said = f"Your answer cannot be used: it {fault}. Answer again."
                messages = (*messages, ChatMessage("assistant", answer.text[:20_000]), ChatMessage("user", said))
                continue
            return Revision(found[-1].strip() + "\n", asked, answer.text)
        raise InfrastructureError(
            f"the model `{self._options.model}` gave no prompt: its answer {fault}", hint="name a stronger model"
        )


def make_reviser(given: Mapping[str, str], calls: ModelCalls) -> ModelReviser:
    """The reviser of the given options. Raises `UsageError` that tells every fault of them."""
    return ModelReviser(read_options(ReviserOptions, given, "reviser"), calls)
