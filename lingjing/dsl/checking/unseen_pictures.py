"""Pictures that an agent does not receive, although it observes fields of a body that has cameras (LJ0403).

`observes uav.position` shows where a body is and none of its pictures. That is ordinary for an agent that sees by the
cameras of a body of its own. It is a likely slip for an agent that controls the body itself, or sees by no body of its
own, as a coordinator: these are warned about.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax import tree as s
from lingjing.mission import expression as ex
from lingjing.mission import model


class PlacedChannel(NamedTuple):
    """One entry of `observes`: where it stands, and its part of the graph."""

    node: s.ObservedChannel
    channel: model.Channel


def warn_of_unseen(
    channels: Sequence[PlacedChannel],
    controls: Sequence[ex.Expr],
    mounted: Mapping[str, Sequence[str]],
    agent: str,
    report: Reporter,
) -> None:
    """Warn of each entry of `channels` by which the agent loses the pictures of a body.

    `mounted` are the names of the cameras by group; `controls` are the bodies that the agent embodies.
    """
    seen = [one.channel.source for one in channels if _shows_pictures(one.channel, mounted)]
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
    """True if one of the others is the same body, or the group of which it is a member, or a member of this group."""
    return any(
        other == source or (_group(other) == _group(source) and not (_is_member(other) and _is_member(source)))
        for other in others
    )


def _is_member(source: ex.Expr) -> bool:
    return isinstance(source, ex.Index)


def _group(source: ex.Expr) -> str:
    """The name of the asset or target that an expression is or is a member of; "" for `events`, `peers` and a grid."""
    base = source.base if isinstance(source, ex.Index) else source
    return base.name if isinstance(base, ex.Ref) else ""
