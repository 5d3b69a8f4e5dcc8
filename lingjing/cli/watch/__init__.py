"""`lingjing run --watch`: an episode in the terminal while it is played.

- `chart`     the map: ground in half blocks, trails in braille, things as glyphs
- `screen`    map, agents and tickers put together for a terminal's size
- `terminal`  the terminal's alternate screen, given back whatever happens
- `displays`  one display an episode, within a share of time that drawing never exceeds
- `viewer_process` not in the terminal: the browser's or Foxglove's view, in a process of its own

What is known at a boundary is `lingjing.viewer.state`. In come the kernel's `Progress` values, one a boundary; nothing
goes back. A watcher knows what the agents were told and what the kernel judged: hidden targets appear when they are
found, or from the start with `--watch-truth`.
"""

from lingjing.cli.watch.displays import EpisodeDisplays

__all__ = ["EpisodeDisplays"]
