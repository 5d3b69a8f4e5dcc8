"""The option of the motion engines, as the model that their plug-ins declare (ADR 0016)."""

from __future__ import annotations

from typing import Literal

from lingjing.plugins.options import Field, PluginOptions


class MotionOptions(PluginOptions):
    """The options of the engines `multirotor`, `vessel`, `road` and `city`."""

    motion: Literal["full", "coarse"] = Field(
        "full",
        description="`coarse`: longer steps and simpler equations, for learners; its episodes are others (ADR 0061)",
    )
