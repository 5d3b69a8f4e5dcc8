"""An episode as a film of 20 seconds: MP4 through PyAV, GIF through Pillow alone. No browser is needed."""

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
from lingjing.viewer.narrated import Narration
from lingjing.whole_files import written_whole

SECONDS = 20.0
TITLE_S, ENDING_S = 2.0, 3.5
MP4_RATE, GIF_RATE = 24, 8
"""Frames a second."""

GIF_SIZE = (640, 360)
SUFFIXES = (".mp4", ".gif")


def make_film(trace: Trace, path: Path, *, truth: bool) -> tuple[str, ...]:
    """Write the film and give notes on what is not as it should be; the suffix says which kind. It is there whole or
    not at all.

    Raises `UsageError` for another suffix, where PyAV is missing, and if the file cannot be written.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"cannot make `{path}`: a film is an .mp4 or a .gif", hint="name it episode.mp4")
    write, rate = (_write_mp4, MP4_RATE) if path.suffix.lower() == ".mp4" else (_write_gif, GIF_RATE)
    if write is _write_mp4:
        _needs_av()
    told = Narration(trace, truth)
    try:
        with written_whole(path) as partial:
            write(film_frames(told, rate), partial, rate)
    except OSError as error:
        raise UsageError(f"cannot write `{path}`: {error.strerror or error}", hint="choose another -o") from error
    return film_notes(told)


def film_notes(told: Narration) -> tuple[str, ...]:
    """What is said once where letters are drawn as boxes."""
    found = moments(told.steps, told.trace, truth=told.truth) if told.steps else ()
    texts = (told.head.title, told.head.goal, told.head.credit, told.ending().line, *(one.text for one in found))
    return note_of_boxes("".join(texts))


def film_frames(told: Narration, rate: int) -> Iterator[Image.Image]:
    """All frames: a title, the episode with its moments, the ending."""
    trace, truth = told.trace, told.truth
    drawn = FilmFrames(trace, told.head, told.steps, told.ground())
    yield from repeat(drawn.title(), round(TITLE_S * rate))
    if told.steps:
        found = moments(told.steps, trace, truth=truth)
        yield from frames_of(drawn, schedule(len(told.steps), found, SECONDS - TITLE_S - ENDING_S, rate), found)
    yield from repeat(drawn.ended(told.ending()), round(ENDING_S * rate))


def _needs_av() -> None:
    try:
        import av  # noqa: F401
    except ImportError:
        raise UsageError("an MP4 needs PyAV", hint=f"{install_line('film')}, or name a .gif") from None


def _write_mp4(frames: Iterator[Image.Image], path: Path, rate: int) -> None:
    """H.264 with 4:2:0 chroma, which every player shows."""
    import av

    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", rate=rate, options={"crf": "21", "preset": "veryfast"})
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        stream.thread_count = 1
        for image in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.asarray(image), format="rgb24")))
        container.mux(stream.encode())


def _write_gif(frames: Iterator[Image.Image], path: Path, rate: int) -> None:
    """One palette for all frames, made of a few of them."""
    small = [image.resize(GIF_SIZE, Image.Resampling.BOX) for image in frames]
    some = small[:: max(1, len(small) // 6)]
    sheet = Image.new("RGB", (GIF_SIZE[0], GIF_SIZE[1] * len(some)))
    for row, image in enumerate(some):
        sheet.paste(image, (0, GIF_SIZE[1] * row))
    palette = sheet.quantize(255, method=Image.Quantize.MEDIANCUT)
    drawn = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in small]
    drawn[0].save(path, format="GIF", save_all=True, append_images=drawn[1:], duration=1000 // rate, loop=0)
