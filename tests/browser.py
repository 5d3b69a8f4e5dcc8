"""A real browser for tests of pages: Debian's Chromium, driven by playwright. `make browser` installs both."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

PROGRAM = shutil.which("chromium") or ""
FLAGS = (
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
PATIENCE_MS = 120_000
FAULTS = "Content Security Policy", "Failed to load resource"
"""Console messages that show an incomplete page."""


def skip_without_a_browser() -> None:
    """Skip the module that calls this where there is no browser, with the reason."""
    pytest.importorskip("playwright.sync_api", reason="playwright is not installed: run `make browser`")
    if not PROGRAM:
        pytest.skip("chromium is not installed: run `make browser`", allow_module_level=True)


@contextmanager
def browser() -> Iterator[Any]:
    """A browser without a window."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=PROGRAM, args=list(FLAGS), timeout=PATIENCE_MS)
        yield opened
        opened.close()


@contextmanager
def opened(browser: Any, url: str, **options: Any) -> Iterator[Any]:
    """A page at `url`. An error of a script, a breach of the page's policy or a request elsewhere
    fails the test."""
    context = browser.new_context(**{"viewport": {"width": 1280, "height": 800}, **options})
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    wrong: list[str] = []
    page.on("pageerror", lambda error: wrong.append(f"error: {error}"))
    page.on("console", lambda said: wrong.append(said.text) if any(word in said.text for word in FAULTS) else None)
    home = url.split("?")[0].rsplit("/", 1)[0]
    page.on("request", lambda asked: wrong.append(f"asks {asked.url[:80]}") if is_foreign(asked.url, home) else None)
    page.goto(url)
    yield page
    context.close()
    assert not wrong, wrong


def is_foreign(url: str, home: str) -> bool:
    """True if an address is neither below the page's own address nor data of the page."""
    return not url.startswith((home, "data:", "blob:"))
