"""A film: its moments, its frames for odd episodes, and the files."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest
from PIL import Image, ImageDraw

from lingjing import Trace
from lingjing.analysis import fonts
from lingjing.errors import UsageError
from lingjing.viewer import film
from lingjing.viewer.film import ENDING_S, SECONDS, TITLE_S, film_frames, film_notes, make_film
from lingjing.viewer.frames import HEIGHT, MAP, SHOT, WIDTH, FilmFrames, _wrapped, font_of
from lingjing.viewer.ground import PageGround
from lingjing.viewer.moments import MOST, Moment, moments, schedule
from lingjing.viewer.page_content import PageContent


def test_the_moments_of_a_film_are_events_in_order_of_time(trace: Trace) -> None:
    steps = PageContent(trace, truth=False).steps
    chosen = moments(steps, trace, truth=False)
    assert 0 < len(chosen) <= MOST and list(chosen) == sorted(chosen, key=lambda moment: moment.place)
    for moment in chosen:
        assert any(event.kind != "plain" and event.text in moment.text for event in steps[moment.place].events)
    gains = [n for n, step in enumerate(steps) if n and step.score > steps[n - 1].score]
    assert set(gains) <= {moment.place for moment in chosen}
    assert [moment.place for moment in moments(steps, trace, truth=False, most=1)] == gains[:1]


def test_a_film_stops_at_its_moments_and_shows_every_boundary() -> None:
    stops = (Moment(3, "good", "a"), Moment(9, "bad", "b"))
    places = schedule(11, stops, 10.0, 24)
    assert len(places) == 240 and places[0] == 0.0 and places[-1] == 10.0
    assert places == sorted(places)
    for moment in stops:
        assert 27 <= sum(place == moment.place for place in places) <= 31  # 1.2 s
    crowd = tuple(Moment(n, "good", "x") for n in range(100))
    assert schedule(100, crowd, 10.0, 24)[-1] == 99.0
    assert set(schedule(1, (), 5.0, 8)) == {0.0}


def test_a_frame_shows_the_picture_and_the_score(trace: Trace) -> None:
    content = PageContent(trace, truth=True)
    drawn = FilmFrames(trace, content.head, content.steps, PageGround(known=False))
    first, last = drawn.played(0.0, None), drawn.played(len(content.steps) - 1.0, Moment(0, "good", "won"))
    assert first.size == last.size == (WIDTH, HEIGHT)
    before, after = np.asarray(first), np.asarray(last)
    for left, top, right, bottom in (SHOT, MAP):
        assert (before[top:bottom, left:right] != after[top:bottom, left:right]).any()
    (left, top), (right, bottom) = SHOT[:2], SHOT[2:]
    assert after[top:bottom, left:right].reshape(-1, 3).std(axis=0).min() > 1.0


def test_an_episode_without_pictures_shows_its_stages_instead(trace: Trace) -> None:
    content = PageContent(trace, truth=True)
    assert content.steps[-1].stages
    with_pictures = FilmFrames(trace, content.head, content.steps, PageGround(known=False)).played(0.0, None)
    blind = [msgspec.structs.replace(step, pictures=[]) for step in content.steps]
    without = FilmFrames(trace, content.head, blind, PageGround(known=False)).played(0.0, None)
    (left, top), (right, bottom) = SHOT[:2], SHOT[2:]
    paper = [
        bool((np.asarray(frame)[bottom - 8, left:right] == (14, 18, 23)).all()) for frame in (with_pictures, without)
    ]
    assert paper == [True, False]
    assert len(np.unique(np.asarray(without)[top : top + 30, left:right].reshape(-1, 3), axis=0)) > 3


def test_frames_are_drawn_for_hostile_texts_and_lost_pictures(trace: Trace, written: Callable[..., Trace]) -> None:
    evil = "\u202e" + "<script>" * 400 + "名前" * 100
    instance = msgspec.structs.replace(trace.header.instance, title=evil, goal=evil)
    header = msgspec.structs.replace(trace.header, instance=instance, attribution=evil)
    for records in ([], list(trace.boundaries[:1]), list(trace.boundaries[:3])):
        lost = Trace(trace.path, header, tuple(records), None, False, {})
        content = PageContent(lost, truth=True)
        drawn = FilmFrames(lost, content.head, content.steps, PageGround(known=False))
        frames = [drawn.title(), drawn.ended(content.ending())]
        frames += [drawn.played(0.0, Moment(0, "bad", evil))] if records else []
        assert {frame.size for frame in frames} == {(WIDTH, HEIGHT)}


def test_a_gif_plays_for_twenty_seconds(trace: Trace, tmp_path: Path) -> None:
    make_film(trace, tmp_path / "episode.gif", truth=False)
    with Image.open(tmp_path / "episode.gif") as made:
        total = 0
        for number in range(made.n_frames):  # type: ignore[attr-defined]
            made.seek(number)
            total += made.info["duration"]
    assert abs(total / 1000 - SECONDS) < 0.5
    assert [path.name for path in tmp_path.iterdir()] == ["episode.gif"]


def test_concurrent_films_of_the_same_name_are_written_to_different_files(
    trace: Trace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts: list[Path] = []

    def write(frames: object, path: Path, rate: int) -> None:
        parts.append(path)
        path.write_bytes(b"a film")

    monkeypatch.setattr(film, "_write_gif", write)
    for number in (1, 2):
        monkeypatch.setattr(os, "getpid", lambda number=number: number)
        make_film(trace, tmp_path / "episode.gif", truth=False)
    assert len(set(parts)) == 2 and [path.name for path in tmp_path.iterdir()] == ["episode.gif"]


def test_an_mp4_is_h264_with_24_pictures_a_second(
    trace: Trace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    av = pytest.importorskip("av", reason="PyAV is not installed: pip install av")
    short = Trace(trace.path, trace.header, trace.boundaries[:2], None, False, trace.places)
    monkeypatch.setattr(film, "SECONDS", 6.0)
    make_film(short, tmp_path / "episode.mp4", truth=False)
    with av.open(str(tmp_path / "episode.mp4")) as made:
        (stream,) = made.streams.video
        assert (stream.codec_context.name, stream.codec_context.width) == ("h264", WIDTH)
        assert sum(1 for _ in made.decode(video=0)) == 6 * 24


def test_a_film_that_cannot_be_made_is_an_error(trace: Trace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match="a film is an"):
        make_film(trace, tmp_path / "episode.avi", truth=False)
    short = Trace(trace.path, trace.header, trace.boundaries[:1], None, False, {})
    with pytest.raises(UsageError, match="cannot write"):
        make_film(short, tmp_path / "no" / "episode.gif", truth=False)
    monkeypatch.setitem(__import__("sys").modules, "av", None)
    with pytest.raises(UsageError, match="an MP4 needs PyAV"):
        make_film(short, tmp_path / "episode.mp4", truth=False)
    assert list(tmp_path.iterdir()) == []


def test_a_film_has_the_frames_of_title_episode_and_ending(trace: Trace) -> None:
    short = Trace(trace.path, trace.header, trace.boundaries[:1], None, False, {})
    frames = list(film_frames(PageContent(short, truth=False), 2))
    assert len(frames) == round(TITLE_S * 2) + round((SECONDS - TITLE_S - ENDING_S) * 2) + round(ENDING_S * 2)


CHINESE = "海上搜救任务：找到落水者"


def test_letters_that_the_default_font_lacks_are_drawn_in_another_font(monkeypatch: pytest.MonkeyPatch) -> None:
    assert fonts.missing_letters("Sea → ° ü") == "" and set(fonts.missing_letters(f"a{CHINESE}a")) == set(CHINESE)
    if fonts.letters_without_a_font(CHINESE):
        pytest.skip("no font with Chinese letters is installed here: apt-get install fonts-noto-cjk")
    pictures = set()
    for letter in "海上搜":
        image = Image.new("L", (40, 40))
        ImageDraw.Draw(image).text((2, 2), letter, font=font_of(letter, 24), fill=255)
        pictures.add(image.tobytes())
    assert len(pictures) == 3  # boxes would be equal
    rows = _wrapped("Find 海上搜救任务找到落水者 all", 24, 120.0)
    assert len(rows) > 2 and "".join(rows).replace(" ", "") == "Find海上搜救任务找到落水者all"
    assert all(font_of(row, 24).getlength(row) <= 120.0 for row in rows)


def test_one_letter_without_a_font_does_not_turn_others_into_boxes() -> None:
    if fonts.letters_without_a_font(CHINESE):
        pytest.skip("no font with Chinese letters is installed here: apt-get install fonts-noto-cjk")
    hieroglyph = "\N{EGYPTIAN HIEROGLYPH A001}"
    if not fonts.letters_without_a_font(hieroglyph):
        pytest.skip("a font here has even hieroglyphs")
    text = f"{CHINESE} {hieroglyph}"
    assert fonts.letters_without_a_font(text) == hieroglyph
    letters = fonts.missing_letters(text)
    assert fonts.font(24, letters).getname() == fonts.font(24, fonts.missing_letters(CHINESE)).getname()


def test_letters_without_a_font_are_reported_once(trace: Trace, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fonts, "_font_with", lambda letters: None)
    instance = msgspec.structs.replace(trace.header.instance, title=CHINESE)
    header = msgspec.structs.replace(trace.header, instance=instance)
    short = Trace(trace.path, header, trace.boundaries[:1], None, False, {})
    (note,) = film_notes(PageContent(short, truth=False))
    assert note.startswith("no font here has '") and "drawn as boxes" in note
    assert film_notes(PageContent(trace, truth=False)) == ()


def test_without_fontconfig_there_is_no_other_font(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    fonts._font_with.cache_clear()
    fonts._fonts.cache_clear()
    assert fonts.letters_without_a_font("海") == "海" and fonts.font(12, "海").getname()[0] == "DejaVu Sans"
    fonts._font_with.cache_clear()
    fonts._fonts.cache_clear()
    fonts.font.cache_clear()
