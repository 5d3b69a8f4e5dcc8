"""`lingjing serve --lj-engine MISSION`: play an episode with bodies of foreign engines, which dial in."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from lingjing.cli.arguments import parse_pairs, parse_seed, parse_settings, parse_whole
from lingjing.cli.process import say
from lingjing.cli.results import explain, print_episode
from lingjing.errors import ExitCode, UsageError
from lingjing.play.report import ABORTED

if TYPE_CHECKING:
    from lingjing.engines.remote.messages import ProfileName

DEFAULT_PORT = "9909"
"""The port of the paper's backend."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `--lj-engine`."""
    group = parser.add_argument_group("with --lj-engine")
    group.add_argument(
        "--session", metavar="ENGINE=ADDRESS", action="append", default=[],
        help="the engine whose bodies the session at ADDRESS owns (multirotor=airsim); default: those that dial in",
    )  # fmt: skip
    group.add_argument(
        "--profile", default="auto",
        help="auto (default: what is acknowledged), open_vocab, delivery, fire_rescue, script: the form of commands",
    )  # fmt: skip
    group.add_argument(
        "--observe", choices=("tick", "sync", "hold"), default="tick",
        help="ask for poses at each boundary (default) or macro-step; hold: do not ask, with --profile script",
    )  # fmt: skip
    group.add_argument(
        "--pictures", choices=("own", "engine"), default="own",
        help="own: our camera at the reported poses (default); engine: the session LJ-ENGINE/image",
    )  # fmt: skip
    group.add_argument(
        "--deadline", metavar="S", default="5", help="the longest wait for an answer, seconds (default 5)"
    )
    group.add_argument("--patience", metavar="S", help="the longest wait for sessions, seconds (default: without end)")


def serve(args: argparse.Namespace, token: str) -> int:
    """Play one episode. Raises the errors of `lingjing.run`."""
    from lingjing.dsl.loading.load import load_mission
    from lingjing.play.options import PlayOptions
    from lingjing.serve.lj_engine.episodes import Serving, new_task_id, serve_episode
    from lingjing.serve.lj_engine.hub import Hub
    from lingjing.serve.lj_engine.server import EngineServer

    if args.mission is None or args.scene is not None:
        raise UsageError("serve --lj-engine needs a MISSION, and no --scene", hint="lingjing serve --lj-engine ssr")
    if args.pace == "wait":
        raise UsageError("--pace wait needs a client that advances time", hint="--pace fast, or --pace wall")
    mission = load_mission(args.mission)
    options = PlayOptions(
        mission=args.mission,
        policy=args.policy,
        seed=parse_seed(args.seed),
        mode=args.mode,
        settings=parse_settings(parse_pairs("--set", args.set), mission),
        world=args.world,
        calls="live",
        overview=False,
    )
    profile = _profile(args.profile)
    deadline_s = float(parse_whole("--deadline", args.deadline, 3600)) or 1.0
    serving = Serving(
        mission, options,
        folder=Path(args.output) if args.output else None,
        sessions=_sessions(args.session),
        profile=profile,
        every_sync=args.observe == "sync",
        asks=args.observe != "hold",
        paced=args.pace == "wall" or (args.pace is None and profile == "script"),
        pictures=args.pictures == "engine",
        deadline_s=deadline_s,
        act_s=min(deadline_s, 3.0),
        patience_s=None if args.patience is None else float(parse_whole("--patience", args.patience, 24 * 3600)),
    )  # fmt: skip
    serving.check()  # reject wrong settings before the server listens
    port = parse_whole("--port", args.port or DEFAULT_PORT, 65_535)
    server = EngineServer(Hub(new_task_id(mission.name)), args.host, port, token)
    say(f"LJ-ENGINE at ws://{args.host}:{server.port}/ws/LJ-ENGINE/ADDRESS; Ctrl-C ends the episode")
    print(f"{args.host}:{server.port}", flush=True)
    try:
        report = serve_episode(serving, server, say)
    finally:
        server.close()
    print_episode(report)
    explain([report])
    return ExitCode.INFRASTRUCTURE if report.reason == ABORTED else ExitCode.OK


def _profile(name: str) -> ProfileName:
    from lingjing.engines.remote.messages import ProfileName

    profile: ProfileName | None = next((known for known in get_args(ProfileName) if known == name), None)
    if profile is None:
        raise UsageError(f"there is no profile `{name}`", hint=f"one of {', '.join(get_args(ProfileName))}")
    return profile


def _sessions(texts: Sequence[str]) -> dict[str, str] | None:
    """Return engine → address; None if none is given. An engine alone gets its usual address."""
    from lingjing.serve.lj_engine.episodes import ADDRESSES
    from lingjing.serve.lj_engine.sessions import key_of

    sessions: dict[str, str] = {}
    for text in texts:
        engine, _, address = text.partition("=")
        address = address or ADDRESSES.get(engine, engine)
        if not engine or key_of(f"/ws/LJ-ENGINE/{address}") is None:
            raise UsageError(f"--session {text} is no ENGINE=ADDRESS", hint="--session multirotor=airsim")
        if engine in sessions:
            raise UsageError(f"--session names the engine `{engine}` twice", hint="one session for each engine")
        sessions[engine] = address
    return sessions or None
