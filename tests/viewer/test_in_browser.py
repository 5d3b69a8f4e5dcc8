"""The player in a real browser: content, keys, a phone, hostile episodes, broken pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

import lingjing
from lingjing import Trace
from lingjing.trace.records import Decision, DecisionRecord
from lingjing.viewer.server import ViewServer
from lingjing.viewer.single import single_file
from lingjing.viewer.trace_source import TraceSource
from tests.browser import browser, opened, skip_without_a_browser

skip_without_a_browser()

READY = "html[data-ready]"


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser() as made:
        yield made


@pytest.fixture
def file_of(tmp_path: Path) -> Callable[..., str]:
    def write(trace: Trace, *, truth: bool = False) -> str:
        path = tmp_path / "episode.html"
        path.write_text(single_file(trace, truth=truth), encoding="utf-8")
        return path.as_uri()

    return write


def tick(page: Any) -> int:
    return int(page.locator("#clock").inner_text().split()[1])


def test_the_file_plays_and_keys_work(chromium: Any, trace: Trace, file_of: Callable[..., str]) -> None:
    with opened(chromium, file_of(trace, truth=True)) as page:
        page.wait_for_selector(READY)
        first = tick(page)
        page.keyboard.press("ArrowRight")
        assert tick(page) == trace.boundaries[1].tick != first
        page.keyboard.press("End")
        assert tick(page) == trace.boundaries[-1].tick
        assert "score" in page.locator("#score-words").inner_text()
        page.keyboard.press("Shift+ArrowLeft")
        before = tick(page)
        assert before < trace.boundaries[-1].tick and page.locator("#toast").inner_text()
        page.keyboard.press("Home")
        page.keyboard.press("Space")
        page.wait_for_selector("#play[aria-label=pause]")
        page.wait_for_selector(f"#clock:not(:text-matches('^tick {first} '))")
        page.keyboard.press("Space")
        page.wait_for_selector("#play[aria-label=play]")
        for key, pane in (("2", "log"), ("3", "relations"), ("4", "goal"), ("1", "agent")):
            page.keyboard.press(key)
            assert page.locator(f"#pane-{pane}").is_visible()
        page.keyboard.press("ArrowDown")
        assert page.locator("#agent").input_value() == trace.header.instance.agents[1].id
        page.keyboard.press("v")
        assert page.locator("#flat").get_attribute("aria-pressed") == "true"
        theme = page.locator("html").get_attribute("data-theme")
        page.keyboard.press("t")
        assert page.locator("html").get_attribute("data-theme") != theme


def test_the_picture_shows_true_and_reported_boxes(chromium: Any, trace: Trace, file_of: Callable[..., str]) -> None:
    with opened(chromium, file_of(trace, truth=True)) as page:
        page.wait_for_selector(READY)
        report = next(
            (record.tick, edge.sender)
            for record in trace.boundaries
            for edge in record.messages
            if edge.category == "report" and edge.body.get("box")
        )
        page.select_option("#agent", report[1])
        number = next(place for place, record in enumerate(trace.boundaries) if record.tick == report[0])
        page.locator("#seek").fill(str(number))
        page.wait_for_selector("#boxes .said")
        assert page.locator("#boxes .truth").count() >= 1
        page.wait_for_selector("#photo:not([hidden])")
        assert "reported by" in page.locator("#key-boxes").inner_text()


def test_without_the_truth_no_hidden_name_is_in_the_page(
    chromium: Any, trace: Trace, file_of: Callable[..., str]
) -> None:
    with opened(chromium, file_of(trace)) as page:
        page.wait_for_selector(READY)
        page.keyboard.press("4")
        assert "hidden" not in page.locator("#targets").inner_text()
        assert page.locator("#boxes .truth").count() == 0
        assert page.locator("#why").is_hidden()


@pytest.mark.parametrize("width", [320, 360, 768])
def test_the_page_fits_the_width_of_a_phone(
    chromium: Any, trace: Trace, file_of: Callable[..., str], width: int
) -> None:
    header = msgspec.structs.replace(trace.header, attribution="© OpenStreetMap contributors, ODbL 1.0")
    named = Trace(trace.path, header, trace.boundaries, trace.outcome, True, trace.places)
    with opened(chromium, file_of(named), viewport={"width": width, "height": 700}, has_touch=True) as page:
        page.wait_for_selector(READY)
        credit, tools, legend = (page.locator(name).bounding_box() for name in ("#credit", "#tools", "#legend"))
        assert credit["y"] > tools["y"] + tools["height"] and legend["y"] + legend["height"] <= credit["y"]
        for pane in ("agent", "log", "relations", "goal"):
            page.locator(f"#tab-{pane}").click()
            assert page.evaluate("document.documentElement.scrollWidth") <= width
        for hidden in ("true", "false"):  # as during a new layout of the page
            page.evaluate(f"document.getElementById('line').hidden = {hidden}; player.size(); player.draw()")
        box = page.locator("#play").bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= width and box["height"] >= 34


def test_a_hostile_episode_is_shown_as_text(
    chromium: Any, trace: Trace, written: Callable[..., Trace], file_of: Callable[..., str]
) -> None:
    evil = (
        "</script><script>document.title='hit'</script><img src=x onerror=document.title='hit'>\u202eabc" + "y" * 10_000
    )
    first, second, *_ = trace.boundaries
    made = tuple(
        DecisionRecord(agent=agent.id, decision=Decision(thought=evil), substituted="policy_error", detail=evil)
        for agent in trace.header.instance.agents
    )
    header = msgspec.structs.replace(
        trace.header,
        attribution=f"© {evil[:80]}",
        instance=msgspec.structs.replace(trace.header.instance, title=evil[:120], goal=evil),
    )
    page_url = file_of(written([first, msgspec.structs.replace(second, decisions=made)], header, finish=False))
    with opened(chromium, page_url) as page:
        page.wait_for_selector(READY)
        page.keyboard.press("End")
        page.wait_for_selector("#facts-agent .thought:text-matches('script')")
        shown = page.locator("#facts-agent .thought").inner_text()
        assert shown.startswith("</script><script>") and "characters more" in shown and "\u202e" not in shown
        assert page.title() != "hit" and page.locator("#credit").inner_text().startswith("map: © </script>")
        assert page.locator("#side img[src=x]").count() == 0
        assert page.evaluate("document.documentElement.scrollWidth") <= 1280


def test_a_phone_shows_the_number_of_further_events_of_a_tick(
    chromium: Any, trace: Trace, written: Callable[..., Trace], file_of: Callable[..., str]
) -> None:
    first, second, *_ = trace.boundaries
    agents = [agent.id for agent in trace.header.instance.agents]
    broken = tuple(
        DecisionRecord(agent=agent, decision=Decision(), substituted="policy_error", detail="out of memory " * 40)
        for agent in agents
    )
    made = written([first, msgspec.structs.replace(second, decisions=broken)], trace.header, finish=False)
    with opened(chromium, file_of(made), viewport={"width": 390, "height": 844}, has_touch=True) as page:
        page.wait_for_selector(READY)
        page.keyboard.press("End")
        rest = page.locator("#toast .rest")
        assert rest.inner_text() == f"and {len(agents) - 2} more"
        toast, inside = page.locator("#toast").bounding_box(), rest.bounding_box()
        assert inside["y"] + inside["height"] <= toast["y"] + toast["height"]
        assert toast["y"] + toast["height"] < page.locator("#stage").bounding_box()["height"]


def test_an_episode_of_200_000_ticks_is_drawn(
    chromium: Any, trace: Trace, written: Callable[..., Trace], file_of: Callable[..., str]
) -> None:
    first, second, *_ = trace.boundaries
    with opened(chromium, file_of(written([first, second], trace.header, finish=False))) as page:
        page.wait_for_selector(READY)
        last = page.evaluate(
            """() => {
                const { steps, source } = player.episode, one = steps[1];
                source.details = async () => [];
                while (steps.length < 200000) steps.push({ ...one, time: one.time + steps.length, tick: steps.length });
                player.go(steps.length - 1);
                return player.step;
            }"""
        )
        assert last == 199_999 and tick(page) == last


def test_an_episode_of_200_agents_one_tick_and_no_picture_is_shown(
    chromium: Any, trace: Trace, written: Callable[..., Trace], file_of: Callable[..., str]
) -> None:
    instance = trace.header.instance
    agent = instance.agents[0]
    crowd = tuple(msgspec.structs.replace(agent, id=f"scout[{n}]", index=n) for n in range(1, 201))
    header = msgspec.structs.replace(trace.header, instance=msgspec.structs.replace(instance, agents=crowd))
    record = msgspec.structs.replace(trace.boundaries[0], frames=(), observations=(), inboxes=(), decisions=())
    with opened(chromium, file_of(written([record], header, finish=False))) as page:
        page.wait_for_selector(READY)
        assert page.locator("#agent option").count() == 200
        assert page.locator("#no-photo").inner_text() == "no picture yet"
        page.keyboard.press("3")
        page.keyboard.press("Space")
        assert page.locator("#graph circle").count() >= 1


def test_an_episode_without_a_boundary_has_a_note(
    chromium: Any, trace: Trace, written: Callable[..., Trace], file_of: Callable[..., str]
) -> None:
    with opened(chromium, file_of(written([], trace.header, finish=False))) as page:
        page.wait_for_selector("#loading:text-matches('no boundary')")
        assert page.locator("#city").is_hidden()  # it would be black


def test_pictures_are_requested_when_shown_and_a_lost_one_has_a_note(chromium: Any, trace: Trace) -> None:
    agent = next(
        item
        for item in trace.header.instance.agents
        if any(item.controls[:1]) and any(frame.entity in item.controls for frame in trace.frames.values())
    )
    own = [frame for frame in trace.frames.values() if frame.entity in agent.controls]
    broken = Trace(trace.path, trace.header, trace.boundaries, trace.outcome, True, {**trace.places, own[0].id: {}})
    server = ViewServer(TraceSource(broken, truth=False))
    requested: list[str] = []
    context = chromium.new_context(viewport={"width": 1280, "height": 800})
    context.set_default_timeout(300_000)
    page = context.new_page()
    page.on("request", lambda item: requested.append(item.url) if "/picture" in item.url else None)
    page.goto(server.url)
    page.wait_for_selector(READY)
    assert requested == []
    page.select_option("#agent", agent.id)
    number = next(place for place, record in enumerate(trace.boundaries) if own[0] in record.frames)
    page.locator("#seek").fill(str(number))
    page.wait_for_selector("#no-photo:text-matches('broken or lost')")
    later = next(place for place, record in enumerate(trace.boundaries) if own[1] in record.frames)
    page.locator("#seek").fill(str(later))
    page.wait_for_selector("#photo:not([hidden])")
    assert page.evaluate("document.getElementById('photo').naturalWidth") == own[1].pose.width
    assert len(requested) == 2
    context.close()
    server.close()


def test_an_episode_plays_in_the_frame_of_a_notebook(chromium: Any, trace: Trace, tmp_path: Path) -> None:
    path = tmp_path / "notebook.html"
    shown = lingjing.show(trace, truth=True)._repr_html_()
    path.write_text(f"<!doctype html><meta charset=utf-8><p>before{shown}<p>after", encoding="utf-8")
    with opened(chromium, path.as_uri()) as page:
        frame = page.frame_locator("iframe")
        frame.locator(READY).wait_for()
        before = frame.locator("#clock").inner_text()
        frame.locator("#seek").fill("1")
        assert frame.locator("#clock").inner_text() != before
        assert page.locator("p").all_inner_texts()[0].startswith("before")
