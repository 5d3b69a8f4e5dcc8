"""`lingjing plugins`: the engines, policies and scenes that this installation offers, and where each comes from."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import msgspec

from lingjing.errors import ExitCode, PluginError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


class Offer(msgspec.Struct, frozen=True, kw_only=True):
    """One thing on offer: `kind` is engine, policy or scene; `source` the plug-in's entry point; `notes` what is
    special about it (where an engine runs, whether a policy sees the truth)."""

    kind: str
    name: str
    source: str
    notes: str = ""
    summary: str = ""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the verb and its options."""
    parser = subparsers.add_parser(
        "plugins", help="list engines, policies and scenes and where they come from", description=__doc__
    )
    parser.add_argument("--output-format", choices=("text", "json"), default="text")


def handler(args: argparse.Namespace) -> int:
    """Print the list; if a plug-in is broken, print which ones load and which do not, and fail as it did."""
    try:
        found = tuple(offers())
    except PluginError:
        _print_entry_points()
        raise
    if args.output_format == "json":
        sys.stdout.write(msgspec.json.encode(found).decode() + "\n")
    else:
        _print(found)
    return ExitCode.OK


def offers() -> Iterator[Offer]:
    """Everything on offer, by kind and name. Raises `PluginError` if a plug-in is broken."""
    from lingjing.plugins.host import PluginHost

    host = PluginHost()
    for engine in host.engines.values():
        notes = f"{engine.place}, sensor" if engine.sensor else engine.place
        source = host.sources["lingjing_engines", engine.name]
        yield Offer(kind="engine", name=engine.name, source=source, notes=notes, summary=engine.summary)
    for policy in host.policies.values():
        notes = "privileged" if policy.privileged else ""
        source = host.sources["lingjing_policies", policy.name]
        yield Offer(kind="policy", name=policy.name, source=source, notes=notes, summary=policy.summary)
    for scene in host.scenes.values():
        source = host.sources["lingjing_scenes", scene.name]
        yield Offer(kind="scene", name=scene.name, source=source, summary=scene.summary)


def _print_entry_points() -> None:
    from importlib.metadata import entry_points

    for entry in sorted(entry_points(group="lingjing"), key=lambda entry: entry.name):
        distribution = f"{entry.dist.name} {entry.dist.version}" if entry.dist else "?"
        print(f"{entry.name}  {entry.value}  {distribution}  {_load_result(entry)}", file=sys.stderr)


def _load_result(entry: EntryPoint) -> str:
    try:
        entry.load()
    except Exception as error:  # noqa: BLE001 - a stranger's module may raise anything; it is shown, not hidden
        return f"does not load: {type(error).__name__}: {error}"
    return "loads"


def _print(found: Iterable[Offer]) -> None:
    rows = [(offer.kind, offer.name, offer.source, offer.notes, offer.summary) for offer in found]
    widths = [max((len(row[column]) for row in rows), default=0) for column in range(4)]
    for row in rows:
        cells = [cell.ljust(width) for cell, width in zip(row[:4], widths, strict=True)]
        print("  ".join([*cells, row[4]]).rstrip())
