"""The page: one script and one style, named by the policy; nothing that an episode says gets out of its data."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import zlib
from collections.abc import Callable
from html.parser import HTMLParser

import msgspec
import pytest

from lingjing.trace.reader import Trace
from lingjing.trace.records import Decision, DecisionRecord
from lingjing.viewer import single
from lingjing.viewer.page import element, page, policy
from lingjing.viewer.page_content import CHUNK
from lingjing.viewer.single import single_file

EMPTY_ICON = {"rel": "icon", "href": "data:,"}
"""Without it a browser asks the server for one."""


class Parts(HTMLParser):
    """Scripts and styles of a page, its elements' ids, and every attribute that would run code or load something."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.scripts: list[str] = []
        self.styles: list[str] = []
        self.data: dict[str, str] = {}
        self.risky: list[tuple[str, str]] = []
        self._open: tuple[str, dict[str, str | None]] | None = None
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        if found == EMPTY_ICON:
            return
        self.risky += [(tag, name) for name in found if name.startswith("on") or name in ("src", "href", "style")]
        if tag in ("script", "style"):
            self._open = (tag, found)

    def handle_data(self, data: str) -> None:
        if self._open is None:
            return
        tag, found = self._open
        if tag == "style":
            self.styles.append(data)
        elif found.get("type") == "text/plain":
            self.data[str(found["id"])] = data
        else:
            self.scripts.append(data)

    def handle_endtag(self, tag: str) -> None:
        self._open = None


def unpacked(parts: Parts, name: str) -> object:
    return json.loads(zlib.decompress(base64.b64decode(parts.data[f"d-{name}"])))


def test_the_policy_names_the_one_script_and_the_one_style(trace: Trace) -> None:
    text = single_file(trace, truth=False)
    parts = Parts(text)
    assert len(parts.scripts) == len(parts.styles) == 1 and parts.risky == []
    (told,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]+)"', text)
    assert told == policy(served=False)
    for kind, body in (("script", parts.scripts[0]), ("style", parts.styles[0])):
        digest = base64.b64encode(hashlib.sha256(body.encode()).digest()).decode()
        assert f"{kind}-src 'sha256-{digest}'" in told
    assert "unsafe" not in told and "connect-src 'none'" in told and "default-src 'none'" in told
    assert "http:" not in text.replace("http://www.w3.org/2000/svg", "") and "https:" not in text


def test_a_file_holds_the_whole_episode(trace: Trace) -> None:
    parts = Parts(single_file(trace, truth=True))
    told = unpacked(parts, "page-start")
    assert isinstance(told, dict) and len(told["steps"]) == len(trace.boundaries)
    assert told["ending"]["state"] == "won" and told["head"]["truth"] is True
    details = unpacked(parts, "details-0")
    assert isinstance(details, list) and len(details) == min(CHUNK, len(trace.boundaries))
    source = json.loads(parts.data["d-source"])
    assert set(source["pictures"]) == set(trace.frames)
    for number in source["pictures"].values():
        assert base64.b64decode(parts.data[f"d-picture-{number}"])[:2] == b"\xff\xd8"


@pytest.mark.parametrize("budget", [0, 20_000, 100_000])
def test_pictures_keep_to_the_budget_and_what_is_left_out_is_said(trace: Trace, budget: int) -> None:
    parts = Parts(single_file(trace, truth=False, budget_bytes=budget))
    pictures = json.loads(parts.data["d-source"])["pictures"]
    size = sum(len(base64.b64decode(parts.data[f"d-picture-{number}"])) for number in pictures.values())
    assert size <= budget
    told = unpacked(parts, "page-start")
    assert isinstance(told, dict)
    if len(pictures) < len(trace.frames):
        said = " ".join(told["notes"])
        assert "not in this file" in said or f"{len(pictures)} of {len(trace.frames)} pictures" in said


def test_what_a_policy_says_stays_data(trace: Trace, written: Callable[..., Trace]) -> None:
    evil = "</script><script>window.hit=1</script><img src=x onerror=hit()>"
    first, second = trace.boundaries[:2]
    made = DecisionRecord(agent=second.decisions[0].agent, decision=Decision(thought=evil))
    instance = msgspec.structs.replace(trace.header.instance, mission="a</title><script>x", title=evil, goal=evil)
    header = msgspec.structs.replace(trace.header, instance=instance, attribution=evil)
    text = single_file(
        written([first, msgspec.structs.replace(second, decisions=(made,))], header, finish=False), truth=True
    )
    parts = Parts(text)
    assert len(parts.scripts) == 1 and parts.risky == [] and "window.hit" not in text
    assert evil in json.dumps(unpacked(parts, "details-0")) and "<title>a&lt;/title&gt;" in text


def test_a_trace_without_a_boundary_makes_a_page(trace: Trace, written: Callable[..., Trace]) -> None:
    told = unpacked(Parts(single_file(written([], trace.header, finish=False), truth=True)), "page-start")
    assert isinstance(told, dict) and told["steps"] == [] and told["ending"]["state"] == "open"


def test_a_lost_picture_is_left_out(trace: Trace, monkeypatch: pytest.MonkeyPatch) -> None:
    lost = next(iter(trace.frames))
    broken = Trace(trace.path, trace.header, trace.boundaries, trace.outcome, True, {**trace.places, lost: {}})
    pictures = json.loads(Parts(single_file(broken, truth=False)).data["d-source"])["pictures"]
    assert set(pictures) == set(trace.frames) - {lost}
    monkeypatch.setattr(Trace, "jpeg", lambda self, name: b"\xff\xd8 no picture")
    assert json.loads(Parts(single_file(trace, truth=False)).data["d-source"])["pictures"] == {}
    assert single.BUDGET_BYTES == 12_000_000


def test_data_with_a_mark_is_refused() -> None:
    with pytest.raises(ValueError, match="no <"):
        element("x", "<b>")
    assert "{{" not in page("t", "", meta_policy=False)
