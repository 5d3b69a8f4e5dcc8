"""An engine that flies the UAVs of a mission in a running AirSim, Cosys-AirSim or Colosseum.

- `plugin`   the declaration
- `options`  the options of the engine
- `session`  the connection: the only module that imports `cosysairsim`
- `engine`   the five methods of `lingjing.plugins.engine.Engine`
"""
