"""The options of `react`: those of its model (`ModelOptions`), and those of its play."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import JsonValue, ValidationInfo, field_validator, model_validator

from lingjing.plugins.options import Field
from lingjing.plugins.policy import UsageError
from lingjing.plugins.scaffold import AgentParts, ScaffoldContext
from lingjing_agents.llm.options import ModelOptions
from lingjing_agents.react.prompt_files import prompt_text

OWN_SCAFFOLD = "react"
"""The scaffold of `react` itself; every other name is an installed scaffold."""


ENCODINGS: Mapping[str, Mapping[str, JsonValue]] = {
    "paper": {
        "request_tokens": 16_384,  # the context of the paper's open models (lingjing.tex, Implementation Details)
        "max_tokens": 2048,  # the paper's output limit
        "structured": "none",  # nothing is enforced by a service: the schema stands in the prompt of every model
        "repairs": 0,  # a malformed answer becomes a no-op (alg:step)
        "images": 2,
        "image_side": 1920,  # the shipped cameras' pictures as they are
        "tiles": 1,
        "crops": 0,
        "history_images": 0,
    }
}
"""Sets of options under which models can be compared. An option that is given besides has priority."""


class ReactOptions(ModelOptions):
    """The options of `react`."""

    encoding: Literal["", "paper"] = Field(
        "", description="a set of options by name: paper is what the suites play with, the same for every model"
    )
    deadline_s: float = Field(80.0, alias="deadline", ge=0.1, le=86_400.0, description="seconds for one decision")
    repairs: int = Field(1, ge=0, le=10, description="how often an answer that cannot be used is asked for again")
    prompt: str = Field("P1", description="the prompt: P0 (one line), P1 (whole), or a file that holds another")
    request_tokens: int = Field(
        16_384, ge=1024, le=1_000_000, description="tokens of a request and its answer, at most, for every model"
    )
    history_tokens: int | None = Field(
        None, ge=0, le=1_000_000, description="earlier ticks that the model is shown, tokens; not given: what fits"
    )
    history_images: int = Field(2, ge=0, le=16, description="pictures of an earlier tick that stay if it reported them")
    memory: bool = Field(True, description="whether the model keeps commitments and a plan from tick to tick")
    research: int = Field(2, ge=0, le=100, description="rounds over all cells that may be searched again; 0: one pass")
    second_view: bool = Field(True, description="whether cameras beside the one straight down are there")
    grid: bool = Field(True, description="whether the model is told of the search cells")
    images: int = Field(4, ge=0, le=16, description="pictures a call, reference pictures among them")
    image_side: int | None = Field(
        None, ge=64, le=8192, description="the longer side of an image at most, pixels; not given: what the model takes"
    )
    tiles: int = Field(1, ge=1, le=4, description="2: each picture also in 2 x 2 parts at full resolution, and so on")
    crops: int = Field(0, ge=0, le=16, description="parts of pictures that the model may see enlarged at a tick")
    scaffold: str = Field(
        OWN_SCAFFOLD, description="the parts around the model: react, or an installed scaffold (`lingjing plugins`)"
    )
    scaffold_args: dict[str, JsonValue] = Field(
        default_factory=dict, validate_default=True, description="the options of the scaffold, a JSON object"
    )
    decider: Literal["model", "sweep", "heuristic"] = Field(
        "model",
        description="what decides: the model, or in its place the plain `sweep` over the cells or the rules of "
        "`heuristic` (no call is made)",
    )

    intervention: Literal["", "A0", "A1", "A2", "A3"] = Field(
        "",
        description="what is given of an inspected route: A0 pictures alone, A1 its ends, A2 roads and a route too, "
        "A3 the next node chosen by A*; not given: what the mission shows",
    )

    @model_validator(mode="before")
    @classmethod
    def _with_encoding(cls, options: Any) -> Any:
        name = options.get("encoding") if isinstance(options, dict) else None
        return {**ENCODINGS[name], **options} if isinstance(name, str) and name in ENCODINGS else options

    @field_validator("prompt")
    @classmethod
    def _is_prompt(cls, name: str) -> str:
        prompt_text(name)
        return name

    @field_validator("scaffold")
    @classmethod
    def _is_scaffold(cls, name: str) -> str:
        if name != OWN_SCAFFOLD:
            from lingjing.plugins.lookup import scaffold_owner

            _checked(lambda: scaffold_owner(name))
        return name

    @field_validator("scaffold_args")
    @classmethod
    def _are_of_scaffold(cls, arguments: dict[str, JsonValue], info: ValidationInfo) -> dict[str, JsonValue]:
        if "scaffold" in info.data:
            _checked(lambda: _builder(info.data["scaffold"], arguments))
        return arguments

    @model_validator(mode="after")
    def _takes_encoding(self) -> ReactOptions:
        """Refuse a model that cannot be sent what the encoding sends to all."""
        if not self.encoding or not self.model:
            return self
        traits = self.profile.traits
        if traits.context is not None and traits.context < self.request_tokens:
            raise ValueError(
                f"`{self.model}` has a context of {traits.context:,} tokens, and the encoding `{self.encoding}` needs "
                f"{self.request_tokens:,}: give a lower request_tokens to all models that are compared"
            )
        images = self.images * (1 if self.tiles == 1 else 1 + self.tiles**2)
        if traits.images and traits.most_images is not None and traits.most_images < images:
            raise ValueError(
                f"`{self.model}` takes {traits.most_images} images, and the encoding `{self.encoding}` sends {images}: "
                "give lower images to all models that are compared"
            )
        return self

    def scaffold_builder(self) -> Callable[[ScaffoldContext], AgentParts]:
        """Return the function that builds the parts of an agent."""
        return _builder(self.scaffold, self.scaffold_args)

    def fingerprint(self) -> dict[str, str]:
        """Return the prompt's name, the SHA-256 of its text, and the distribution of a scaffold other than `react`."""
        prompt = prompt_text(self.prompt)
        encoding = ENCODINGS.get(self.encoding, {})
        deciding = {**super().fingerprint(), **{name: f"{getattr(self, name)}" for name in encoding}}
        deciding = {**deciding, "prompt": f"{Path(prompt.name).name} sha256:{prompt.sha256}"}
        if self.scaffold != OWN_SCAFFOLD:
            from lingjing.plugins.lookup import scaffold_owner

            deciding["scaffold"] = f"{self.scaffold} of {scaffold_owner(self.scaffold)}"
        return deciding


def _builder(name: str, arguments: Mapping[str, JsonValue]) -> Callable[[ScaffoldContext], AgentParts]:
    if name == OWN_SCAFFOLD:
        if arguments:
            raise UsageError(f"the scaffold `{OWN_SCAFFOLD}` has no options", hint="leave scaffold_args out")
        return lambda context: context.react
    from lingjing.plugins.lookup import scaffold_builder  # its search for plug-ins costs time

    return scaffold_builder(name, arguments)


def _checked(call: Callable[[], object]) -> None:
    """Raise `ValueError` with the text of a `UsageError`: one of several faults of the options."""
    try:
        call()
    except UsageError as error:
        raise ValueError(f"cannot be used: {error}") from error  # the fault keeps the hint of its cause
