"""The policies `reader` and `sighted-reader`: `react` over a player that knows its requests alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pydantic import model_validator

from lingjing.plugins.calls import ModelCalls
from lingjing.plugins.languages import ORIGINAL
from lingjing.plugins.options import Field
from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, UsageError
from lingjing_agents.heuristic.target_types import Detectors
from lingjing_agents.react.options import ReactOptions
from lingjing_agents.react.policy import ReactPolicy
from lingjing_agents.reader.player import RequestPlayer
from lingjing_agents.reader.service import MODEL, PlayerService
from lingjing_agents.reader.true_boxes import TrueBoxes

_ANY_ADDRESS = "http://127.0.0.1:0/v1"
"""The address until the service has a port."""


class ReaderOptions(ReactOptions):
    """The options of `reader`: those of `react`, with the player as the model and the encoding of the suites."""

    model: str = Field(MODEL, description="the player's name at its service")
    price_in: float | None = Field(0.0, ge=0.0, le=1e6, description="US dollars per million tokens: a program is free")
    price_out: float | None = Field(0.0, ge=0.0, le=1e6, description="US dollars per million tokens: a program is free")

    @model_validator(mode="before")
    @classmethod
    def _of_the_player(cls, options: Any) -> Any:
        return {"encoding": "paper", "base_url": _ANY_ADDRESS, "vision": "yes", **options, "model": MODEL}


class SightedOptions(ReaderOptions):
    """The options of `sighted-reader`."""

    withheld: float = Field(
        0.0,
        ge=0.0,
        le=1.0,
        description="the share of true boxes that the player does not get, drawn by picture and target",
    )


class ReaderPolicy:
    """The policy of one agent: `react`, over a service of its own with the player."""

    def __init__(self, options: ReaderOptions, calls: ModelCalls) -> None:
        self._options, self._calls = options, calls

    async def reset(self, brief: Brief) -> None:
        """Start the service and `react`. Raises `UsageError` for requests in another language than English."""
        if brief.language != ORIGINAL:
            raise UsageError(
                f"the request-only player reads requests in `{ORIGINAL}` alone, and the episode is played in "
                f"`{brief.language}`",
                hint="leave `language` out, or play with `react` and a model",
            )
        self._service = PlayerService(RequestPlayer(self._detectors))
        options = self._options.model_copy(update={"base_url": self._service.url})
        self._react = ReactPolicy(options, self._calls)
        await self._react.reset(brief)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the decision of `react`."""
        return await self._react.act(observation, inbox)

    def _detectors(self, brief: Brief) -> Detectors:
        """Return no detectors: the rules of colours and shapes see."""
        return {}


class SightedReaderPolicy(ReaderPolicy):
    """`ReaderPolicy` with the true boxes of the pictures that its requests hold."""

    def __init__(self, options: SightedOptions, calls: ModelCalls) -> None:
        super().__init__(options, calls)
        self._boxes = TrueBoxes(options.withheld)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Keep the true boxes of the new pictures, then return the decision of `react`."""
        assert observation.privileged is not None, "declared privileged"
        self._boxes.keep(observation.privileged.frames)
        return await super().act(replace(observation, privileged=None), inbox)

    def _detectors(self, brief: Brief) -> Detectors:
        """Return the detectors of the true boxes."""
        return self._boxes.detectors(brief)
