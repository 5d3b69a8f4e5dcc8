"""An episode as a film of 20 seconds: MP4 by PyAV, GIF by Pillow. No browser is needed."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import repeat
from pathlib import Path

import numpy as np
from PIL import Image

from lingjing.analysis.fonts import note_of_boxes
from lingjing.errors import UsageError
from lingjing.installation import install_line
from lingjing.trace.reader import Trace
from lingjing.viewer.frames import HEIGHT, WIDTH, FilmFrames, frames_of
from lingjing.viewer.moments import moments, schedule
from lingjing.viewer.page_content import PageContent
from lingjing.whole_files import written_whole

SECONDS = 20.0
"""Length of the film. Chosen."""
TITLE_S, ENDING_S = 2.0, 3.5
"""Parts of it for the title and the ending. Chosen."""
MP4_RATE, GIF_RATE = 24, 8
"""Frames per second. Chosen; GIF has fewer because it compresses badly."""

GIF_SIZE = (640, 360)
"""Width and height of a GIF, pixels. Chosen."""
SUFFIXES = (".mp4", ".gif")


def make_film(trace: Trace, path: Path, *, truth: bool) -> tuple[str, ...]:
    """Write the film, and return notes on missing letters. The suffix of `path` selects MP4 or GIF.

    The file appears under its name only when it is complete. Raises `UsageError` for another suffix, if PyAV is missing
    for an MP4, and if the file cannot be written.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"cannot make `{path}`: a film is an .mp4 or a .gif", hint="name it episode.mp4")
    write, rate = (_write_mp4, MP4_RATE) if path.suffix.lower() == ".mp4" else (_write_gif, GIF_RATE)
    if write is _write_mp4:
        _needs_av()
    content = PageContent(trace, truth)
    try:
        with written_whole(path) as partial:
            write(film_frames(content, rate), partial, rate)
    except OSError as error:
        raise UsageError(f"cannot write `{path}`: {error.strerror or error}", hint="choose another -o") from error
    return film_notes(content)


def film_notes(content: PageContent) -> tuple[str, ...]:
    """Return a note if letters are drawn as boxes, else an empty tuple."""
    shown = moments(content.steps, content.trace, truth=content.truth) if content.steps else ()
    head = content.head
    texts = (head.title, head.goal, head.credit, content.ending().line, *(moment.text for moment in shown))
    return note_of_boxes("".join(texts))


def film_frames(content: PageContent, rate: int) -> Iterator[Image.Image]:
    """Yield all frames: the title, the episode with its moments, and the ending."""
    trace, steps = content.trace, content.steps
    drawn = FilmFrames(trace, content.head, steps, content.ground())
    yield from repeat(drawn.title(), round(TITLE_S * rate))
    if steps:
        shown = moments(steps, trace, truth=content.truth)
        yield from frames_of(drawn, schedule(len(steps), shown, SECONDS - TITLE_S - ENDING_S, rate), shown)
    yield from repeat(drawn.ended(content.ending()), round(ENDING_S * rate))


def _needs_av() -> None:
    try:
        import av  # noqa: F401
    except ImportError:
        raise UsageError("an MP4 needs PyAV", hint=f"{install_line('film')}, or name a .gif") from None


def _write_mp4(frames: Iterator[Image.Image], path: Path, rate: int) -> None:
    """Write H.264 with 4:2:0 chroma subsampling, which every player supports."""
    import av

    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", rate=rate, options={"crf": "21", "preset": "veryfast"})
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        stream.thread_count = 1
        for image in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.asarray(image), format="rgb24")))
        container.mux(stream.encode())


def _write_gif(frames: Iterator[Image.Image], path: Path, rate: int) -> None:
    """Write a GIF with one palette for all frames, which is computed from about six of them."""
    small = [image.resize(GIF_SIZE, Image.Resampling.BOX) for image in frames]
    some = small[:: max(1, len(small) // 6)]
    sheet = Image.new("RGB", (GIF_SIZE[0], GIF_SIZE[1] * len(some)))
    for row, image in enumerate(some):
        sheet.paste(image, (0, GIF_SIZE[1] * row))
    palette = sheet.quantize(255, method=Image.Quantize.MEDIANCUT)
    drawn = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in small]
    drawn[0].save(path, format="GIF", save_all=True, append_images=drawn[1:], duration=1000 // rate, loop=0)
