"""`lingjing lsp`, mostly in a separate process with a real client over standard input and output."""

from __future__ import annotations

import asyncio
import os
import sys
import time
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio

from lingjing.testing import mission_file

pytest.importorskip("pygls", reason="the extra `lsp` is not installed")

from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException
from pygls.lsp.client import LanguageClient

from lingjing.lsp.server import create

SSR = mission_file("ssr").read_text(encoding="utf-8")
URI = "file:///nowhere/ssr.ljs"


class Editor(LanguageClient):
    """A client that stores the publications of the server."""

    def __init__(self) -> None:
        super().__init__("test-editor", "1")
        self.published: dict[str, list[lsp.PublishDiagnosticsParams]] = {}
        self.capabilities = lsp.ServerCapabilities()
        self.received = asyncio.Event()
        self.text = ""
        self.version = 0

    async def diagnostics(self, *, beyond: int = 0, uri: str = URI) -> list[lsp.Diagnostic]:
        """The diagnostics after the first `beyond` publications."""
        while len(self.published.get(uri, [])) <= beyond:
            self.received.clear()
            await asyncio.wait_for(self.received.wait(), 600)
        return list(self.published[uri][-1].diagnostics)

    def open(self, text: str, uri: str = URI) -> None:
        self.text, self.version = text, 1
        item = lsp.TextDocumentItem(uri, "ljs", 1, text)
        self.text_document_did_open(lsp.DidOpenTextDocumentParams(item))

    def type(self, line: int, column: int, text: str, *, end: tuple[int, int] | None = None) -> None:
        """Insert a text at a place (code units), or replace a range."""
        begin = lsp.Position(line, column)
        stop = lsp.Position(*end) if end else begin
        change = lsp.TextDocumentContentChangePartial(range=lsp.Range(begin, stop), text=text)
        self.version += 1
        document = lsp.VersionedTextDocumentIdentifier(self.version, URI)
        self.text_document_did_change(lsp.DidChangeTextDocumentParams(document, [change]))


def place(text: str, word: str) -> lsp.Position:
    """The beginning of a word, in UTF-16 code units."""
    before = text[: text.index(word)]
    line = before.count("\n")
    return lsp.Position(line, len(before.rsplit("\n", 1)[-1].encode("utf-16-le")) // 2)


DOCUMENT = lsp.TextDocumentIdentifier(URI)


@pytest_asyncio.fixture
async def editor() -> AsyncIterator[Editor]:
    client = Editor()

    @client.feature(lsp.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
    def published(params: lsp.PublishDiagnosticsParams) -> None:
        client.published.setdefault(params.uri, []).append(params)
        client.received.set()

    await client.start_io(sys.executable, "-m", "lingjing.cli.main", "lsp", "--stdio")
    started = await client.initialize_async(
        lsp.InitializeParams(capabilities=lsp.ClientCapabilities(), process_id=os.getpid(), root_uri=None)
    )
    client.capabilities = started.capabilities
    client.initialized(lsp.InitializedParams())
    yield client
    if client._server is not None and client._server.returncode is None:
        await asyncio.wait_for(client.shutdown_async(None), 600)
        client.exit(None)
        assert await asyncio.wait_for(client._server.wait(), 600) == 0
    await client.stop()


async def test_errors_appear_and_disappear_as_the_author_types(editor: Editor) -> None:
    editor.open(SSR)
    assert await editor.diagnostics() == []
    where = place(SSR, "10 s, sync")
    editor.type(where.line, where.character + 3, "kg", end=(where.line, where.character + 4))
    (fault,) = await editor.diagnostics(beyond=1)
    assert (fault.code, fault.source, fault.severity) == ("LJ0203", "lingjing", lsp.DiagnosticSeverity.Error)
    assert fault.range.start == where
    editor.type(where.line, where.character + 3, "s", end=(where.line, where.character + 5))
    assert await editor.diagnostics(beyond=2) == []


async def test_no_version_of_a_text_is_checked_twice_while_the_author_types(editor: Editor) -> None:
    editor.open(SSR)
    await editor.diagnostics()
    for number in range(20):
        editor.type(0, 5 + number, "1")
    while editor.published[URI][-1].version != 21:
        await editor.diagnostics(beyond=len(editor.published[URI]))
    assert [fault.code for fault in editor.published[URI][-1].diagnostics] == ["LJ0117"]
    versions = [publication.version for publication in editor.published[URI]]
    assert versions == sorted(set(versions))


async def test_fast_typing_causes_one_check(monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock stands still between the edits, so that no delay of the machine is a pause of the author."""
    server, loop, checked = create(), asyncio.get_running_loop(), []
    monkeypatch.setattr(server, "analysis", lambda uri: server.analyses[uri][1])
    monkeypatch.setattr(server, "_diagnostics", lambda text: checked.append(text) or [])
    monkeypatch.setattr(server, "text_document_publish_diagnostics", lambda _: None)
    with monkeypatch.context() as standstill:
        now = loop.time()
        standstill.setattr(loop, "time", lambda: now)
        for version in range(20):
            server.analyses[URI] = (version, f"text {version}")
            server.check_soon(URI)
            for _ in range(5):
                await asyncio.sleep(0)  # other tasks run, no time passes
    await server.checks[URI]
    assert checked == ["text 19"]


async def test_the_server_answers_requests_about_a_broken_file(editor: Editor) -> None:
    broken = SSR.replace("clock {", "clock {{{ =").replace("} }\n", "\n") + "\nmission {"
    editor.open(broken)
    assert len(await editor.diagnostics()) >= 2
    symbols = await editor.text_document_document_symbol_async(lsp.DocumentSymbolParams(DOCUMENT))
    assert symbols
    assert await editor.text_document_formatting_async(_formatting()) is None
    for word in ("search =", "quadrotor", "victim["):
        await editor.text_document_hover_async(lsp.HoverParams(DOCUMENT, place(broken, word)))
        await editor.text_document_completion_async(lsp.CompletionParams(DOCUMENT, place(broken, word)))
        await editor.text_document_definition_async(lsp.DefinitionParams(DOCUMENT, place(broken, word)))


async def test_columns_are_utf16(editor: Editor) -> None:
    text = SSR.replace('"Sea search and rescue"', '"海上搜救 😀😀"').replace(
        "  mode broadcast", "  region 水域 = circle((0 m, 0 m), 3 kg)  # 😀\n  mode broadcast"
    )
    editor.open(text)
    (fault,) = await editor.diagnostics()
    assert fault.range.start == place(text, "3 kg")
    line = place(text, "mission ssr").line
    title = text.splitlines()[line]
    editor.type(line, len(title[: title.index('"', 13)].encode("utf-16-le")) // 2, "😀 x")
    assert (await editor.diagnostics(beyond=1))[0].range.start == place(text, "3 kg")
    edit = await editor.text_document_rename_async(lsp.RenameParams(DOCUMENT, place(text, "水域"), "水"))
    assert edit is not None and edit.changes is not None
    (change,) = edit.changes[URI]
    start = place(text, "水域")
    assert change.range == lsp.Range(start, lsp.Position(start.line, start.character + 2))
    place_of_grid = place(text, "search {")
    location = await editor.text_document_definition_async(lsp.DefinitionParams(DOCUMENT, place_of_grid))
    assert isinstance(location, lsp.Location) and location.range.start == place(text, "search =")


async def test_completion_hover_definition_and_references_are_answered(editor: Editor) -> None:
    text = SSR.replace("  success", "  stage x { done when boat. }\n  success")
    editor.open(text)
    where = place(text, "boat. }")
    cursor = lsp.Position(where.line, where.character + 5)
    completion = await editor.text_document_completion_async(lsp.CompletionParams(DOCUMENT, cursor))
    assert isinstance(completion, lsp.CompletionList)
    assert {"position", "heading", "speed"} <= {item.label for item in completion.items}
    hover = await editor.text_document_hover_async(lsp.HoverParams(DOCUMENT, place(text, "altitude")))
    assert hover is not None and isinstance(hover.contents, lsp.MarkupContent)
    assert "a length in `m`" in hover.contents.value
    into = await editor.text_document_definition_async(lsp.DefinitionParams(DOCUMENT, place(text, "quadrotor")))
    assert isinstance(into, lsp.Location) and into.uri.endswith("/std/air.ljs")
    places = await editor.text_document_references_async(
        lsp.ReferenceParams(lsp.ReferenceContext(include_declaration=True), DOCUMENT, place(text, "uavs "))
    )
    assert places is not None and len(places) == SSR.count("uavs")


async def test_signatures_semantic_tokens_folds_and_unit_hints_are_returned(editor: Editor) -> None:
    text = (
        "ljs 1\nuse std.air\nuse std.sea\n# a note\n# of two lines\nmission m {\n  param far = 3 km in 1 m..9 km\n"
        "  region r = circle((far, 5 m), far)\n  adjudicate near(v: victim) { when now > 3 s }\n"
        "  stage s {\n    done when near(victim)\n  }\n}\n"
    )
    editor.open(text)
    for word, label, active in (
        ("(far, 5", "circle(centre: position, radius: length)", 0),
        ("far)", "circle(centre: position, radius: length)", 1),
        ("victim)\n", "near(v: victim)", 0),
    ):
        help_there = await editor.text_document_signature_help_async(
            lsp.SignatureHelpParams(DOCUMENT, place(text, word))
        )
        assert help_there is not None
        assert help_there.signatures[0].label == label and help_there.active_parameter == active
    outside = lsp.SignatureHelpParams(DOCUMENT, place(text, "stage s"))
    assert await editor.text_document_signature_help_async(outside) is None

    folds = await editor.text_document_folding_range_async(lsp.FoldingRangeParams(DOCUMENT))
    shown = {(fold.start_line, fold.end_line, str(getattr(fold.kind, "value", fold.kind))) for fold in folds or ()}
    assert shown == {(1, 2, "imports"), (3, 4, "comment"), (5, 11, "region"), (9, 10, "region")}

    whole = lsp.Range(lsp.Position(0, 0), lsp.Position(20, 0))
    hints = await editor.text_document_inlay_hint_async(lsp.InlayHintParams(DOCUMENT, whole))
    assert [(hint.position.line, hint.label) for hint in hints or ()] == [
        (6, " = 3000 m"), (6, " = 9000 m"), (7, ": m"), (7, ": m"),
    ]  # fmt: skip

    tokens = await editor.text_document_semantic_tokens_full_async(lsp.SemanticTokensParams(DOCUMENT))
    assert tokens is not None
    legend = editor.capabilities.semantic_tokens_provider.legend.token_types
    words, line, column = [], 0, 0
    for start in range(0, len(tokens.data), 5):
        down, right, length, kind, _ = tokens.data[start : start + 5]
        line, column = line + down, right if down else column + right
        words.append((text.split("\n")[line][column : column + length], legend[kind]))
    assert words[:7] == [
        ("ljs", "keyword"), ("1", "number"), ("use", "keyword"), ("std", "enumMember"), ("air", "property"),
        ("use", "keyword"), ("std", "enumMember"),
    ]  # fmt: skip
    expected = {
        ("# a note", "comment"), ("far", "variable"), ("3 km", "number"), ("circle", "function"), ("near", "function"),
        ("v", "parameter"), ("when", "keyword"),
    }  # fmt: skip
    assert expected <= set(words)


async def test_a_rename_is_returned_or_refused_with_a_reason(editor: Editor) -> None:
    editor.open(SSR)
    edit = await editor.text_document_rename_async(lsp.RenameParams(DOCUMENT, place(SSR, "uavs "), "n"))
    assert edit is not None and edit.changes is not None
    assert len(edit.changes[URI]) == SSR.count("uavs")
    for name, why in (("victims", "already declared"), ("1x", "no name"), ("region", "word of the language")):
        with pytest.raises(JsonRpcException, match=why):
            await editor.text_document_rename_async(lsp.RenameParams(DOCUMENT, place(SSR, "uavs "), name))


def _formatting() -> lsp.DocumentFormattingParams:
    return lsp.DocumentFormattingParams(DOCUMENT, lsp.FormattingOptions(tab_size=4, insert_spaces=False))


async def test_formatting_and_code_actions_return_edits(editor: Editor) -> None:
    text = SSR.replace("  scene bay", "scene bay").replace("takeoff,", "takeof,")
    editor.open(text)
    (fault,) = await editor.diagnostics()
    (edit,) = await editor.text_document_formatting_async(_formatting()) or []
    assert edit.new_text == SSR.replace("takeoff,", "takeof,")
    context = lsp.CodeActionContext([fault])
    actions = await editor.text_document_code_action_async(lsp.CodeActionParams(DOCUMENT, fault.range, context))
    action = (actions or [])[0]
    assert isinstance(action, lsp.CodeAction) and action.edit is not None and action.edit.changes is not None
    assert [change.new_text for change in action.edit.changes[URI]] == ["takeoff"]
    elsewhere = lsp.Range(lsp.Position(0, 0), lsp.Position(0, 0))
    assert not await editor.text_document_code_action_async(lsp.CodeActionParams(DOCUMENT, elsewhere, context))


async def test_closing_removes_the_diagnostics(editor: Editor) -> None:
    editor.open("ljs 1\nmission")
    assert await editor.diagnostics()
    editor.text_document_did_close(lsp.DidCloseTextDocumentParams(DOCUMENT))
    assert await editor.diagnostics(beyond=1) == []


async def test_a_library_without_errors_has_no_diagnostics(editor: Editor, tmp_path: Path) -> None:
    file = tmp_path / "lib.ljs"
    file.write_text("ljs 1\nasset tug { engine = vessel }\n")
    uri = file.as_uri()
    editor.open(file.read_text(), uri)
    assert await editor.diagnostics(uri=uri) == []


async def test_a_changed_library_is_read_again_when_it_is_saved(editor: Editor, tmp_path: Path) -> None:
    """The editor reports the save of the library. The text that uses it is open and is not changed."""
    library, uri = tmp_path / "boats.ljs", (tmp_path / "harbour.ljs").as_uri()
    good = "ljs 2\nuse std.sea { lifeboat }\nasset tug : lifeboat { }\n"
    library.write_text(good)
    editor.open("ljs 2\nuse .boats { tug }\nasset big : tug { }\n", uri)
    assert await editor.diagnostics(uri=uri) == []
    saved = lsp.DidSaveTextDocumentParams(lsp.TextDocumentIdentifier(library.as_uri()))
    library.write_text(good.replace("asset tug", "asset barge"))
    editor.text_document_did_save(saved)
    (fault,) = await editor.diagnostics(beyond=1, uri=uri)
    assert (fault.code, fault.range.start.line) == ("LJ0101", 1)
    library.write_text(good)
    editor.text_document_did_save(saved)
    assert await editor.diagnostics(beyond=2, uri=uri) == []


def long_mission(lines: int) -> str:
    """A mission of about that many lines, without more entities than cameras can draw."""
    entities = "\n".join(
        f"  target t{n} : person_in_water {{\n    position = ({n}.5 m, -{n}.25 m)\n    drift = 0.{n % 9 + 1} m/s\n  }}"
        for n in range(lines // 4)
    )
    return SSR.replace("  asset boat", f"{entities}\n  asset boat")


@pytest.mark.parametrize("lines", [1_000, pytest.param(10_000, marks=pytest.mark.thorough)])
async def test_a_long_mission_is_checked_and_its_timings_are_recorded(
    editor: Editor, lines: int, record_property: pytest.RecordProperty
) -> None:  # type: ignore[name-defined]
    text = long_mission(lines)
    started = time.monotonic()
    editor.open(text)
    assert await editor.diagnostics() == []
    opened = time.monotonic() - started
    where = place(text, "10 s, sync")
    started = time.monotonic()
    editor.type(where.line, where.character + 3, "kg", end=(where.line, where.character + 4))
    assert [fault.code for fault in await editor.diagnostics(beyond=1)] == ["LJ0203"]
    typed = time.monotonic() - started
    timings = {"open": opened, "edit": typed}
    for name, ask in (
        ("hover", editor.text_document_hover_async(lsp.HoverParams(DOCUMENT, place(text, "altitude")))),
        ("again", editor.text_document_hover_async(lsp.HoverParams(DOCUMENT, place(text, "quadrotor")))),
        ("complete", editor.text_document_completion_async(lsp.CompletionParams(DOCUMENT, place(text, "success")))),
        ("format", editor.text_document_formatting_async(_formatting())),
    ):
        started = time.monotonic()
        await ask
        timings[name] = time.monotonic() - started
    for name, seconds in timings.items():
        record_property(name, round(seconds, 3))
    print(timings)


async def test_a_cancelled_request_does_not_harm_the_server(editor: Editor) -> None:
    editor.open(long_mission(700))
    requests = [
        asyncio.ensure_future(editor.text_document_hover_async(lsp.HoverParams(DOCUMENT, lsp.Position(30 + n, 8))))
        for n in range(5)
    ]
    await asyncio.sleep(0.05)
    for number in list(editor.protocol._request_futures):
        editor.protocol.notify("$/cancelRequest", lsp.CancelParams(id=number))
    done = await asyncio.gather(*requests, return_exceptions=True)
    assert len(done) == 5
    assert await editor.text_document_document_symbol_async(lsp.DocumentSymbolParams(DOCUMENT))


async def test_shutdown_during_a_check_leaves_no_process(editor: Editor) -> None:
    editor.open(long_mission(1500))
    await asyncio.sleep(0.1)
    await asyncio.wait_for(editor.shutdown_async(None), 600)
    editor.exit(None)
    server = editor._server
    assert server is not None
    assert await asyncio.wait_for(server.wait(), 600) == 0
    assert not Path(f"/proc/{server.pid}").exists()


async def test_the_server_ends_when_the_client_disconnects(editor: Editor) -> None:
    server = editor._server
    assert server is not None and server.stdin is not None
    editor.open(SSR)
    await editor.diagnostics()
    server.stdin.close()
    await asyncio.wait_for(server.wait(), 600)
    assert not Path(f"/proc/{server.pid}").exists()
