"""The distances of stages that end the mission when they are late, from the rules of a brief.

As long as the target is not seen, it may be at any place of the region. A searcher that has come within such a
distance of every place is not late for that stage, wherever the target is.
"""

from __future__ import annotations

import re

from lingjing.plugins.policy import Brief

_STAGE = re.compile(
    r"^the stage \*\w+\* must be done within \d+ ticks .*the horizontal distance .* is at most `([\d.]+) m`"
)


def timely_distances_m(brief: Brief) -> tuple[float, ...]:
    """Return these distances in metres, the greatest first, which is that of the first stage."""
    matches = (_STAGE.search(rule) for rule in brief.rules)
    return tuple(sorted((float(match[1]) for match in matches if match), reverse=True))
