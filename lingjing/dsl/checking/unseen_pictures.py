"""The warning LJ0403: an agent observes fields of a body that has cameras, but does not receive its pictures.

`observes uav.position` shows the place of a body and none of its pictures. That is usual for an agent that sees through
the cameras of its own body. It is a likely mistake for an agent that controls the observed body, or for one without
cameras of its own, such as a coordinator. These get the warning.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax import tree as s
from lingjing.mission import expression as ex
from lingjing.mission import model


class PlacedChannel(NamedTuple):
    """One entry of `observes`."""

    node: s.ObservedChannel
    """Its place in the text."""
    channel: model.Channel
    """Its part of the mission graph."""


def warn_of_unseen(
    channels: Sequence[PlacedChannel],
    controls: Sequence[ex.Expr],
    mounted: Mapping[str, Sequence[str]],
    agent: str,
    report: Reporter,
) -> None:
    """Warn of each entry of `channels` that lacks the pictures of a body.

    `mounted`: names of the cameras by group. `controls`: bodies that the agent embodies.
    """
    seen = [placed.channel.source for placed in channels if _shows_pictures(placed.channel, mounted)]
    has_eyes = any(_covers(body, seen) for body in controls)
    warned: list[ex.Expr] = []
    for node, channel in channels:
        cameras = mounted.get(_group(channel.source), ())
        is_blind = bool(cameras) and not _covers(channel.source, [*seen, *warned])
        if is_blind and (not has_eyes or _covers(channel.source, controls)):
            warned.append(channel.source)
            body = report.source.text[node.source.start : node.source.end].rpartition(".")[0]
            named = ", ".join(f"{body}.{camera}" for camera in cameras)
            report.at(
                "LJ0403",
                node,
                f"`{agent}` observes fields of `{body}` and receives no picture of its cameras",
                f"add them: `observes {named}`, or `{body}.*` for everything",
                severity="warning",
            )


def _shows_pictures(channel: model.Channel, mounted: Mapping[str, Sequence[str]]) -> bool:
    cameras = mounted.get(_group(channel.source), ())
    return bool(cameras) and ("*" in channel.fields or any(name in cameras for name in channel.fields))


def _covers(source: ex.Expr, others: Sequence[ex.Expr]) -> bool:
    """True if one of the others is the same body, or the group that contains it, or a member of this group."""
    return any(
        other == source or (_group(other) == _group(source) and not (_is_member(other) and _is_member(source)))
        for other in others
    )


def _is_member(source: ex.Expr) -> bool:
    return isinstance(source, ex.Index)


def _group(source: ex.Expr) -> str:
    """The name of the group or entity that an expression refers to; "" for `events`, `peers` and a grid."""
    base = source.base if isinstance(source, ex.Index) else source
    return base.name if isinstance(base, ex.Ref) else ""
