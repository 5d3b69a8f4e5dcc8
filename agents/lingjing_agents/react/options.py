"""The options of `react`: the model that it asks (`ModelOptions`), and what it is played with."""

from __future__ import annotations

from lingjing.plugins.options import Field
from lingjing_agents.llm.options import ModelOptions


class ReactOptions(ModelOptions):
    """What `react` can be told."""

    deadline_s: float = Field(80.0, alias="deadline", ge=0.1, le=86_400.0, description="seconds for one decision")
    repairs: int = Field(2, ge=0, le=10, description="how often an answer that cannot be used is asked for again")
    history: int = Field(6, ge=0, le=1000, description="earlier ticks that the model is shown")
    image_side: int = Field(1280, ge=64, le=8192, description="the longer side of a picture, pixels")
    images: int = Field(2, ge=0, le=16, description="pictures a call")
