"""The options of the engine; `lingjing plugins airsim` lists them."""

from __future__ import annotations

from lingjing.plugins.options import Field, PluginOptions


class AirsimOptions(PluginOptions):
    """The options of the engine; `--engine-arg airsim.host=10.0.0.5` sets one."""

    host: str = Field("127.0.0.1", description="the address of AirSim")
    port: int = Field(41451, ge=1, le=65535, description="the port of AirSim's API")
    vehicles: str = Field("", description="names of AirSim's vehicles in the order of the UAVs, with commas")
    timeout_s: float = Field(30.0, alias="timeout", gt=0.0, le=3600.0, description="longest wait for a call, seconds")
    arrived_m: float = Field(1.0, alias="arrived", gt=0.0, le=10.0, description="distance of arrival, metres")
    resets: bool = Field(True, description="reset AirSim at the start of an episode")
