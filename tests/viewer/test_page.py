"""The page: one script and one style with hashes in the policy; texts of an episode stay within its data."""

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

from lingjing import Trace
from lingjing.trace.records import Decision, DecisionRecord
from lingjing.viewer import single
from lingjing.viewer.page import element, page, policy
from lingjing.viewer.page_content import CHUNK
from lingjing.viewer.single import single_file

EMPTY_ICON = {"rel": "icon", "href": "data:,"}
"""Without it, a browser requests an icon from the server."""


class Parts(HTMLParser):
    """Scripts and styles of a page, the ids of its elements, and all attributes that would run code or load data."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.scripts: list[str] = []
        self.styles: list[str] = []
        self.data: dict[str, str] = {}
        self.risky: list[tuple[str, str]] = []
        self._open: tuple[str, dict[str, str | None]] | None = None
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = dict(attrs)
        if attributes == EMPTY_ICON:
            return
        self.risky += [(tag, name) for name in attributes if name.startswith("on") or name in ("src", "href", "style")]
        if tag in ("script", "style"):
            self._open = (tag, attributes)

    def handle_data(self, data: str) -> None:
        if self._open is None:
            return
        tag, attributes = self._open
        if tag == "style":
            self.styles.append(data)
        elif attributes.get("type") == "text/plain":
            self.data[str(attributes["id"])] = data
        else:
            self.scripts.append(data)

    def handle_endtag(self, tag: str) -> None:
        self._open = None


def unpacked(parts: Parts, name: str) -> object:
    return json.loads(zlib.decompress(base64.b64decode(parts.data[f"d-{name}"])))


def test_the_policy_has_the_hashes_of_the_script_and_the_style(trace: Trace) -> None:
    text = single_file(trace, truth=False)
    parts = Parts(text)
    assert len(parts.scripts) == len(parts.styles) == 1 and parts.risky == []
    (sent,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]+)"', text)
    assert sent == policy(served=False)
    for kind, body in (("script", parts.scripts[0]), ("style", parts.styles[0])):
        digest = base64.b64encode(hashlib.sha256(body.encode()).digest()).decode()
        assert f"{kind}-src 'sha256-{digest}'" in sent
    assert "unsafe" not in sent and "connect-src 'none'" in sent and "default-src 'none'" in sent
    assert "http:" not in text.replace("http://www.w3.org/2000/svg", "") and "https:" not in text


def test_a_file_contains_the_whole_episode(trace: Trace) -> None:
    parts = Parts(single_file(trace, truth=True))
    start = unpacked(parts, "page-start")
    assert isinstance(start, dict) and len(start["steps"]) == len(trace.boundaries)
    assert start["ending"]["state"] == "won" and start["head"]["truth"] is True
    details = unpacked(parts, "details-0")
    assert isinstance(details, list) and len(details) == min(CHUNK, len(trace.boundaries))
    source = json.loads(parts.data["d-source"])
    assert set(source["pictures"]) == set(trace.frames)
    for number in source["pictures"].values():
        assert base64.b64decode(parts.data[f"d-picture-{number}"])[:2] == b"\xff\xd8"


@pytest.mark.parametrize("budget", [0, 20_000, 100_000])
def test_pictures_fit_the_budget_and_a_note_names_the_missing_ones(trace: Trace, budget: int) -> None:
    parts = Parts(single_file(trace, truth=False, budget_bytes=budget))
    pictures = json.loads(parts.data["d-source"])["pictures"]
    size = sum(len(base64.b64decode(parts.data[f"d-picture-{number}"])) for number in pictures.values())
    assert size <= budget
    start = unpacked(parts, "page-start")
    assert isinstance(start, dict)
    if len(pictures) < len(trace.frames):
        notes = " ".join(start["notes"])
        assert "not in this file" in notes or f"{len(pictures)} of {len(trace.frames)} pictures" in notes


def test_the_text_of_a_policy_stays_within_the_data_of_the_page(trace: Trace, written: Callable[..., Trace]) -> None:
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


def test_a_trace_without_a_boundary_has_a_page(trace: Trace, written: Callable[..., Trace]) -> None:
    start = unpacked(Parts(single_file(written([], trace.header, finish=False), truth=True)), "page-start")
    assert isinstance(start, dict) and start["steps"] == [] and start["ending"]["state"] == "open"


def test_a_lost_picture_is_left_out(trace: Trace, monkeypatch: pytest.MonkeyPatch) -> None:
    lost = next(iter(trace.frames))
    broken = Trace(trace.path, trace.header, trace.boundaries, trace.outcome, True, {**trace.places, lost: {}})
    pictures = json.loads(Parts(single_file(broken, truth=False)).data["d-source"])["pictures"]
    assert set(pictures) == set(trace.frames) - {lost}
    monkeypatch.setattr(Trace, "jpeg", lambda self, name: b"\xff\xd8 no picture")
    assert json.loads(Parts(single_file(trace, truth=False)).data["d-source"])["pictures"] == {}
    assert single.BUDGET_BYTES == 12_000_000


def test_data_with_an_angle_bracket_is_rejected() -> None:
    with pytest.raises(ValueError, match="no <"):
        element("x", "<b>")
    assert "{{" not in page("t", "", meta_policy=False)
