"""The declaration of this package. Lingjing imports it at every start, so heavy imports belong in the factory."""

from __future__ import annotations

from lingjing.plugins.engine import Engine, EnginePlugin
from lingjing.plugins.hookspecs import hookimpl


def _engine() -> Engine:
    from lingjing_airsim.engine import AirsimEngine

    return AirsimEngine()


ENGINE = EnginePlugin(
    name="airsim",
    factory=_engine,
    place="remote",
    native_dt_s=0.01,
    options="lingjing_airsim.options:AirsimOptions",
    summary="UAVs of a running AirSim, Cosys-AirSim or Colosseum, in lockstep through its API.",
)


@hookimpl
def lingjing_api_version() -> str:
    """Return the version of the plug-in contract that this package uses (`lingjing.plugins.contract`)."""
    return "1.19"


@hookimpl
def lingjing_engines() -> tuple[EnginePlugin, ...]:
    """Return the engine of this package."""
    return (ENGINE,)
