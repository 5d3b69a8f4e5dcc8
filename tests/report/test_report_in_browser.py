"""The page in a real browser: on a desktop, on a phone, in print, light and dark."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from lingjing.errors import ExitCode
from lingjing.testing import run_command
from tests.browser import browser, opened, skip_without_a_browser

skip_without_a_browser()

LEAST_PX = 8.5
"""Smallest permitted letters of a drawing, in pixels."""

SMALLEST = """() => Math.min(...[...document.querySelectorAll('figure.panel svg')].flatMap(svg => {
    const scale = svg.getBoundingClientRect().width / svg.viewBox.baseVal.width;
    return [...svg.querySelectorAll('text')].map(text => scale * parseFloat(getComputedStyle(text).fontSize));
}))"""
OUTSIDE = """() => [...document.querySelectorAll('figure.panel text')].filter(text => {
    const own = text.getBoundingClientRect(), box = text.closest('svg').getBoundingClientRect();
    return own.left < box.left - 2 || own.right > box.right + 2;
}).map(text => text.textContent)"""
MOVED = """() => [...document.querySelectorAll('figure .scroll')].filter(box => box.scrollWidth > box.clientWidth + 1)
    .map(box => box.closest('figure').textContent.slice(0, 40))"""
KEPT = "() => [...document.querySelectorAll('h2, .about, thead')].map(each => getComputedStyle(each).breakAfter)"
INK = "() => getComputedStyle(document.querySelector('figure.panel text[style*=\"--ink\"]')).fill"


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser() as made:
        yield made


@pytest.fixture(scope="module")
def page_url(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("page") / "report.html"
    assert run_command(["report", str(runs), "-o", str(path)]) == ExitCode.OK
    return path.as_uri()


@pytest.mark.parametrize("width", [390, 1280])
def test_the_page_fits_its_width_and_its_letters_are_large_enough(chromium: Any, page_url: str, width: int) -> None:
    with opened(chromium, page_url, viewport={"width": width, "height": 844}) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.evaluate(SMALLEST) >= LEAST_PX
        assert page.evaluate(OUTSIDE) == []
        assert page.locator("svg[role=img] > title").count() == page.locator("svg").count()
        if width > 1000:
            assert page.evaluate(MOVED) == [], "a picture is whole where there is room for it"
        page.locator("nav a", has_text="Maps").click()
        assert page.evaluate("document.querySelector('#maps').getBoundingClientRect().top") < 400


def test_dark_mode_and_print_have_their_own_colours_and_layout(chromium: Any, page_url: str) -> None:
    with opened(chromium, page_url, color_scheme="dark") as page:
        dark = page.evaluate(INK)
        page.emulate_media(media="print")
        assert page.evaluate(INK) != dark, "paper is white"
        assert page.locator("nav").is_hidden()
        assert set(page.evaluate(KEPT)) == {"avoid"}, "a heading stays on the page of its content"
        page.set_viewport_size({"width": 720, "height": 1000})
        assert page.evaluate("document.documentElement.scrollWidth") <= 720
        assert page.pdf(format="A4").startswith(b"%PDF")
