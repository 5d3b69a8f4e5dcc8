"""`lingjing engine --connect URL`: play our engines for a backend that speaks LJ-ENGINE."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import get_args

from lingjing.cli.arguments import parse_seed
from lingjing.cli.installed import warn_of_broken_plugins
from lingjing.cli.process import say
from lingjing.errors import ExitCode, UsageError

_ENGINES = ("multirotor", "plane", "quadruped", "road", "vessel", "satellite")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--connect", metavar="URL", required=True, help="the backend: ws://127.0.0.1:9909/ws/LJ-ENGINE/airsim"
    )
    parser.add_argument(
        "--engine", metavar="NAME", action="append", default=[],
        help="an engine that a backend of this project may use (default: all that move bodies)",
    )  # fmt: skip
    parser.add_argument(
        "--profile", default="any",
        help="any (default), open_vocab, delivery, fire_rescue or script: the commands that are answered",
    )  # fmt: skip
    parser.add_argument("--telemetry", metavar="S", help="push poses with this period, seconds (default: not at all)")
    parser.add_argument("--seed", metavar="N", default="0", help="the seed of what a scenario leaves open (default 0)")
    parser.add_argument("--token-file", metavar="FILE", help="a file with the token of the backend")
    parser.add_argument("--once", action="store_true", help="end after one episode")


def handler(args: argparse.Namespace) -> int:
    """Serve the backend until it closes the connection."""
    from lingjing.serve.lj_engine.answers import ClientProfile, EngineSettings
    from lingjing.serve.lj_engine.client import checked_url, serve_backend

    warn_of_broken_plugins()
    host, address = checked_url(args.connect)
    if args.profile not in get_args(ClientProfile):
        raise UsageError(f"there is no profile `{args.profile}`", hint=f"one of {', '.join(get_args(ClientProfile))}")
    unknown = [name for name in args.engine if name not in _ENGINES]
    if unknown:
        raise UsageError(f"no engine that moves bodies is called `{unknown[0]}`", hint=f"known: {', '.join(_ENGINES)}")
    settings = EngineSettings(
        address=address,
        backend_host=host,
        profile=args.profile,
        telemetry_s=_period(args.telemetry),
        seed=parse_seed(args.seed),
    )
    token = _token(args.token_file)
    say(f"dialling {args.connect}")
    serve_backend(args.connect, settings, tuple(args.engine) or _ENGINES, token, once=args.once, say=say)
    return ExitCode.OK


def _period(text: str | None) -> float | None:
    if text is None:
        return None
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 0.01 <= seconds <= 3600:
        raise UsageError(f"--telemetry {text}: must be a period of 0.01 to 3600 seconds", hint="--telemetry 0.5")
    return seconds


def _token(path: str | None) -> str:
    if path is None:
        return ""
    try:
        return Path(path).read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"cannot read {path}", hint="a file with one line") from error
