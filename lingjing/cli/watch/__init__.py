"""`lingjing run --watch`: an episode in the terminal while it is played.

- `displays`  one display per episode, which limits its share of the time
- `screen`    the whole screen: map, agents and messages for the size of a terminal
- `chart`     the map: ground in half blocks, trails in braille dots, entities as glyphs
- `terminal`  the terminal's alternate screen, restored on every exit
- `viewer_process` the browser's or Foxglove's view, in a separate process

`lingjing.viewer.state` holds the state at a boundary. The input is one `Progress` value of the kernel per boundary;
the display never changes the episode. It shows what the agents received and the kernel reported: hidden targets appear
when they are found, or from the start with `--watch-truth`.
"""

from lingjing.cli.watch.displays import EpisodeDisplays

__all__ = ["EpisodeDisplays"]
