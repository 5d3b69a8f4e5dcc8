"""`lingjing serve --airsim MISSION|--scene CITY`: serve an episode to clients of AirSim's API.

`lingjing serve --lj-engine MISSION` is in `lingjing.cli.serve_engines`.
"""

from __future__ import annotations

import argparse
import importlib.util
import tempfile
from pathlib import Path

from lingjing.cli import serve_engines
from lingjing.cli.arguments import parse_pairs, parse_seed, parse_settings, parse_whole
from lingjing.cli.installed import warn_of_broken_plugins
from lingjing.cli.process import say
from lingjing.cli.results import print_episode
from lingjing.errors import ExitCode, UsageError
from lingjing.installation import install_line
from lingjing.mission.model import Mission
from lingjing.play.report import ABORTED

_LOOPBACK = ("127.0.0.1", "::1", "localhost")
_PORT = "41451"
"""AirSim's port."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("mission", metavar="MISSION", nargs="?", help="a mission's file, or a shipped name")
    parser.add_argument("--airsim", action="store_true", help="speak AirSim's MessagePack-RPC")
    parser.add_argument("--lj-engine", action="store_true", help="be the backend of the paper's engines")
    parser.add_argument(
        "--scene", metavar="CITY", help="without a mission: fly in a kind of scene, a map's file or folder"
    )
    parser.add_argument("--drones", metavar="N", default="1", help="the number of drones with --scene (default 1)")
    parser.add_argument(
        "--camera", metavar="WxH", default="256x144", help="the size of pictures with --scene (default 256x144)"
    )
    parser.add_argument("--minutes", metavar="N", default="60", help="the longest episode with --scene (default 60)")
    parser.add_argument("--seed", metavar="N", default="0", help="the episode's seed (default 0)")
    parser.add_argument("--mode", metavar="MODE", help="communication mode (default: the mission's)")
    parser.add_argument("--set", metavar="NAME=VALUE", action="append", default=[], help="set a mission parameter")
    parser.add_argument(
        "--policy", metavar="NAME|FILE.py:CLASS", default="idle", help="the policy of other agents (default idle)"
    )
    parser.add_argument("--tick", metavar="MS", default="50", help="the length of a tick, milliseconds (default 50)")
    parser.add_argument(
        "--pace",
        choices=("wall", "fast", "wait"),
        help="how time passes while no call waits for it: as the wall clock (default), as fast as possible (default of "
        "--lj-engine), not at all",
    )
    parser.add_argument("--once", action="store_true", help="end when the last client has left")
    parser.add_argument(
        "--host", metavar="ADDRESS", default="127.0.0.1", help="the address to listen at (default 127.0.0.1)"
    )
    parser.add_argument("--port", metavar="N", help=f"the port to listen at (default {_PORT}, or 9909; 0: a free one)")
    parser.add_argument(
        "--token-file", metavar="FILE", help="a file with the token that clients must give, for addresses of a network"
    )
    parser.add_argument(
        "--open-to-network", action="store_true", help="listen at an address of a network without a token"
    )
    parser.add_argument("-o", "--output", metavar="DIR", help="a new or empty folder (default: a new one in runs/)")
    parser.add_argument("--no-overview", action="store_true", help="do not draw overview.png (it takes a few seconds)")
    parser.add_argument("--world", choices=("process", "inline"), default="process", help=argparse.SUPPRESS)
    serve_engines.add_options(parser)


def handler(args: argparse.Namespace) -> int:
    """Serve episodes until the mission ends, the last client leaves, or an interrupt."""
    if args.airsim and args.lj_engine:
        raise UsageError("--airsim and --lj-engine are two servers", hint="start one, and the other beside it")
    warn_of_broken_plugins()
    return serve_engines.serve(args, _token(args)) if args.lj_engine else _serve_airsim(args)


def _serve_airsim(args: argparse.Namespace) -> int:
    from lingjing.dsl.loading.load import load_mission
    from lingjing.play.options import PlayOptions

    if importlib.util.find_spec("msgpack") is None:
        raise UsageError("AirSim's API needs the package msgpack", hint=install_line("airsim"))
    from lingjing.serve.airsim.episodes import Serving, serve_episodes
    from lingjing.serve.airsim.missions import checked_tick
    from lingjing.serve.airsim.server import CallServer

    if not args.airsim:
        raise UsageError("no protocol is named", hint="lingjing serve --airsim MISSION, or --lj-engine MISSION")
    if (args.mission is None) == (args.scene is None):
        raise UsageError(
            "serve needs a MISSION or --scene CITY, and not both", hint="lingjing serve --airsim --scene bay"
        )
    tick_s = checked_tick(parse_whole("--tick", args.tick, 10_000))
    port = parse_whole("--port", args.port or _PORT, 65_535)
    mission = load_mission(args.mission) if args.mission is not None else _free_flight(args)
    options = PlayOptions(
        mission=args.mission or "free_flight",
        policy=args.policy,
        seed=parse_seed(args.seed),
        mode=args.mode,
        settings=parse_settings(parse_pairs("--set", args.set), mission),
        world=args.world,
        calls="live",
        overview=not args.no_overview,
    )
    folder = Path(args.output) if args.output else None
    serving = Serving(
        mission=mission,
        options=options,
        tick_s=tick_s,
        pace=args.pace or "wall",
        once=args.once,
        moves_cameras=args.scene is not None,
        folder=folder,
    )
    serving.instance()  # a wrong mode, setting or mission is refused before the server listens
    token = _token(args)
    server = CallServer(args.host, port, token)
    say(f"AirSim's API at {args.host} port {server.port}; Ctrl-C ends the episode")
    print(f"{args.host}:{server.port}", flush=True)
    try:
        reports = serve_episodes(serving, server)
    finally:
        server.close()
    for report in reports:
        print_episode(report)
    return ExitCode.INFRASTRUCTURE if any(report.reason == ABORTED for report in reports) else ExitCode.OK


def _free_flight(args: argparse.Namespace) -> Mission:
    """Return the mission of `--scene`."""
    from lingjing.dsl.loading.load import load_mission
    from lingjing.serve.airsim.missions import MOST_DRONES, free_flight

    drones = parse_whole("--drones", args.drones, MOST_DRONES)
    minutes = parse_whole("--minutes", args.minutes, 24 * 60)
    sizes = args.camera.lower().split("x")
    if len(sizes) != 2:
        raise UsageError(f"--camera {args.camera}: a size is WIDTHxHEIGHT", hint="--camera 640x360")
    width, height = (parse_whole("--camera", size, 4096) for size in sizes)
    if drones == 0 or minutes == 0 or width == 0 or height == 0:
        raise UsageError("--drones, --minutes and --camera must be at least 1", hint="leave them out for the defaults")
    text = free_flight(args.scene, drones, width, height, minutes)
    with tempfile.TemporaryDirectory(prefix="lingjing-") as folder:
        path = Path(folder) / "free_flight.ljs"
        path.write_text(text, encoding="utf-8")
        return load_mission(path)


def _token(args: argparse.Namespace) -> str:
    """Return the token; "" for none. Raises `UsageError` if an address of a network has no protection."""
    if args.token_file is not None:
        try:
            token = Path(args.token_file).read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is no text"
            raise UsageError(f"cannot read {args.token_file}: {reason}", hint="a file with one line") from error
        if len(token) < 8:
            raise UsageError(f"the token in {args.token_file} is short", hint="at least 8 letters")
        return token
    if args.host not in _LOOPBACK and not args.open_to_network:
        hint = "give --token-file FILE, or --open-to-network if every program of the network may fly"
        raise UsageError(f"{args.host} can be reached from a network, and the protocol has no password", hint=hint)
    return ""
