"""A kit for tests: instances, episodes and traces in one line, for this project's tests and those of plug-in authors.

A test needs a mission (`compiled`, `instantiate`, `placed`), plays it to its end (`play`) or boundary by boundary
(`episode`), and reads decisions, receipts, events and records. An engine alone is driven by `EngineRun`. Nothing here
needs pytest. `docs/testing.md` shows a test of each kind of plug-in; the checks of a plug-in's promises are those of
`lingjing.plugins.conformance`.

- `missions`: missions, instances and cities ← a text, a file or the name of a shipped mission
- `documents`: missions as JSON
- `declarations`, `expressions`: the parts of missions and conditions that are built by hand
- `decisions`, `policies`: decisions in one line, and a policy that makes scripted ones
- `engines`: one engine, driven by macro-steps, and small worlds for it
- `stand_ins`: bodies and a camera that do exactly what a test sets
- `worlds`: several engines in one world, without agents
- `episodes`: an episode of the kernel, boundary by boundary
- `playing`: a whole episode, and a command of the command line, in one call
- `traces`: traces of chosen records
- `pictures`: JPEG pictures as cameras store them
- `rescue`: a small rescue by hand, with engines of point masses
- `sea_rescue`: the records and pictures of a sea rescue that was not played
"""

from lingjing.testing.decisions import CENTRE_BOX, does, reports, says, together
from lingjing.testing.engines import EngineRun, declared, drive, open_sea, quay, square
from lingjing.testing.episodes import Episode, episode
from lingjing.testing.missions import (
    Compilation,
    MissionSource,
    PluginHost,
    at_tier,
    bare_instance,
    brief_of,
    city_of,
    compile_file,
    compile_text,
    compiled,
    instantiate,
    mission_file,
    placed,
    shipped_missions,
    shortened,
)
from lingjing.testing.pictures import decode_jpeg, encode_jpeg
from lingjing.testing.playing import PlayedEpisode, play, recorded_calls, run_command
from lingjing.testing.policies import ScriptedPolicy, build_policy, scripted
from lingjing.testing.stand_ins import Stage, StandIns
from lingjing.testing.traces import TraceWriter, header_of, outcome_of, write_trace

__all__ = [
    "CENTRE_BOX", "Compilation", "EngineRun", "Episode", "MissionSource", "PlayedEpisode", "PluginHost",
    "ScriptedPolicy", "Stage", "StandIns", "TraceWriter", "at_tier", "bare_instance", "brief_of", "build_policy",
    "city_of", "compile_file", "compile_text", "compiled", "declared", "decode_jpeg", "does", "drive", "encode_jpeg",
    "episode", "header_of", "instantiate", "mission_file", "open_sea", "outcome_of", "placed", "play", "quay",
    "recorded_calls", "reports", "run_command", "says", "scripted", "shipped_missions", "shortened", "square",
    "together", "write_trace",
]  # fmt: skip
