"""The protocol: pygls over standard input and output. The only module that imports pygls and lsprotocol."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar
from urllib.parse import unquote, urlsplit

from lsprotocol import types as lsp
from pygls import uris
from pygls.exceptions import JsonRpcInvalidParams
from pygls.lsp.server import LanguageServer

from lingjing import __version__
from lingjing.dsl.formatting.formatter import format_source
from lingjing.dsl.source.text import SourceText
from lingjing.errors import LingjingError, hint_of
from lingjing.lsp import colours, signatures
from lingjing.lsp import complete as completing
from lingjing.lsp import explain as explaining
from lingjing.lsp import outline as outlining
from lingjing.lsp import rename as renaming
from lingjing.lsp.analysis import Analysis, library_file
from lingjing.lsp.folding import folds
from lingjing.lsp.hints import unit_hints
from lingjing.lsp.positions import Positions, TextPosition
from lingjing.mission.diagnostics import Diagnostic, Edit, Fix, Span

DELAY_S = 0.2
"""Pause after a keystroke until the text is checked, seconds (chosen)."""

T = TypeVar("T")
_SEVERITY = {
    "error": lsp.DiagnosticSeverity.Error,
    "warning": lsp.DiagnosticSeverity.Warning,
    "note": lsp.DiagnosticSeverity.Information,
}
_ITEM_KINDS = {
    "keyword": lsp.CompletionItemKind.Keyword,
    "name": lsp.CompletionItemKind.Variable,
    "property": lsp.CompletionItemKind.Property,
    "field": lsp.CompletionItemKind.Field,
    "unit": lsp.CompletionItemKind.Unit,
    "function": lsp.CompletionItemKind.Function,
    "verb": lsp.CompletionItemKind.Method,
    "type": lsp.CompletionItemKind.Class,
    "value": lsp.CompletionItemKind.EnumMember,
    "module": lsp.CompletionItemKind.Module,
}
_SYMBOL_KINDS = {
    "mission": lsp.SymbolKind.Module,
    "param": lsp.SymbolKind.Constant,
    "region": lsp.SymbolKind.Namespace,
    "grid": lsp.SymbolKind.Array,
    "asset": lsp.SymbolKind.Object,
    "target": lsp.SymbolKind.Object,
    "agent": lsp.SymbolKind.Class,
    "message": lsp.SymbolKind.Struct,
    "record": lsp.SymbolKind.Struct,
    "adjudicate": lsp.SymbolKind.Function,
    "unlock": lsp.SymbolKind.Function,
    "verb": lsp.SymbolKind.Method,
    "event": lsp.SymbolKind.Event,
}


class Server(LanguageServer):
    """The server: the newest analysis of each open text, and the pending checks."""

    def __init__(self) -> None:
        super().__init__("lingjing", __version__, text_document_sync_kind=lsp.TextDocumentSyncKind.Incremental)
        self.analyses: dict[str, tuple[int, Analysis]] = {}
        self.checks: dict[str, asyncio.Task[None]] = {}
        self.busy = asyncio.Lock()

    def analysis(self, uri: str) -> Analysis:
        """The analysis of the present text. Its parts are computed on first use."""
        document = self.workspace.get_text_document(uri)
        version = document.version if document.version is not None else -1
        known = self.analyses.get(uri)
        if known is None or known[0] != version:
            known = self.analyses[uri] = (version, Analysis(document.source, _path(uri)))
        return known[1]

    def positions(self, source: SourceText) -> Positions:
        """Positions of a text in the encoding that was negotiated with the client."""
        return Positions(source, str(getattr(self.workspace.position_encoding, "value", "utf-16")))

    async def off_loop(self, work: Callable[[], T]) -> T:
        """Run work in a thread, one at a time, so that the event loop stays responsive."""
        async with self.busy:
            return await asyncio.to_thread(work)

    # -- checks

    def check_soon(self, uri: str, delay: float = DELAY_S) -> None:
        """Check the text after a delay. A pending check is cancelled."""
        self.cancel_check(uri)
        self.checks[uri] = asyncio.get_running_loop().create_task(self._check(uri, delay))

    def cancel_check(self, uri: str) -> None:
        """Cancel the pending check."""
        task = self.checks.pop(uri, None)
        if task is not None:
            task.cancel()

    async def _check(self, uri: str, delay: float) -> None:
        await asyncio.sleep(delay)
        analysis = self.analysis(uri)
        version = self.analyses[uri][0]
        diagnostics = await self.off_loop(lambda: self._diagnostics(analysis))
        if self.analyses.get(uri, (None, None))[1] is analysis:
            shown = lsp.PublishDiagnosticsParams(uri, diagnostics, version if version >= 0 else None)
            self.text_document_publish_diagnostics(shown)

    def _diagnostics(self, analysis: Analysis) -> list[lsp.Diagnostic]:
        positions = self.positions(analysis.source)
        try:
            diagnostics = analysis.diagnostics
        except LingjingError as error:  # such as an unreadable library, or two plug-ins of one name
            nothing = lsp.Range(lsp.Position(0, 0), lsp.Position(0, 0))
            message = f"{error}\n{hint_of(error)}" if hint_of(error) else str(error)
            return [lsp.Diagnostic(nothing, message, lsp.DiagnosticSeverity.Error, source="lingjing")]
        return [self.diagnostic(item, positions, analysis.source.path) for item in diagnostics]

    def diagnostic(self, diagnostic: Diagnostic, positions: Positions, path: str) -> lsp.Diagnostic:
        """Convert a diagnostic of the compiler to the protocol."""
        related = [
            lsp.DiagnosticRelatedInformation(self.location(item.span, positions, path), item.message)
            for item in diagnostic.related
        ]
        return lsp.Diagnostic(
            range=_range(positions, diagnostic.span.start, diagnostic.span.end),
            message=f"{diagnostic.message}\n{diagnostic.hint}" if diagnostic.hint else diagnostic.message,
            severity=_SEVERITY[diagnostic.severity],
            code=diagnostic.code,
            source="lingjing",
            related_information=related or None,
        )

    def location(self, span: Span, positions: Positions, path: str) -> lsp.Location:
        """Convert a span of this text or of a library to the protocol."""
        if span.path == path:
            return lsp.Location(_uri(path), _range(positions, span.start, span.end))
        begin = lsp.Position(span.line - 1, span.column - 1)
        return lsp.Location(_uri(span.path), lsp.Range(begin, lsp.Position(span.end_line - 1, span.end_column - 1)))


def create() -> Server:
    """Create a server with all features, not yet connected."""
    server = Server()
    for feature, handler, options in _FEATURES:
        server.feature(feature, options)(handler)
    return server


def serve() -> None:
    """Serve standard input and output until the client sends `exit` or disconnects."""
    logging.getLogger("pygls").setLevel(logging.CRITICAL)
    sys.stdout.flush()
    incoming, outgoing = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of other code must not get into the protocol's stream
    with contextlib.suppress(KeyboardInterrupt):
        create().start_io(incoming, outgoing)


# -- documents


async def opened(server: Server, params: lsp.DidOpenTextDocumentParams) -> None:
    """Check a text when it is opened."""
    server.check_soon(params.text_document.uri, 0.0)


async def changed(server: Server, params: lsp.DidChangeTextDocumentParams) -> None:
    """Check a changed text when the author pauses."""
    server.check_soon(params.text_document.uri)


async def closed(server: Server, params: lsp.DidCloseTextDocumentParams) -> None:
    """Drop the analysis and the diagnostics of a closed text."""
    uri = params.text_document.uri
    server.cancel_check(uri)
    server.analyses.pop(uri, None)
    server.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(uri, []))


async def saved(server: Server, _params: lsp.DidSaveTextDocumentParams) -> None:
    """Check all open texts: the saved file may be a library of another one."""
    for uri in list(server.workspace.text_documents):
        server.analyses.pop(uri, None)
        server.check_soon(uri, 0.0)


async def ended(server: Server, *_: object) -> None:
    """Cancel all checks at shutdown."""
    for uri in list(server.checks):
        server.cancel_check(uri)


# -- questions


async def complete(server: Server, params: lsp.CompletionParams) -> lsp.CompletionList:
    """The proposals at the cursor."""
    analysis = server.analysis(params.text_document.uri)
    positions = server.positions(analysis.source)
    offset = _offset(positions, params.position)
    completion = await server.off_loop(lambda: completing.complete(analysis, offset))
    place = _range(positions, completion.start, completion.end)
    items = [
        lsp.CompletionItem(
            label=item.label,
            kind=_ITEM_KINDS[item.kind],
            detail=item.detail or None,
            sort_text=f"{number:04d}",
            text_edit=lsp.TextEdit(place, item.label),
        )
        for number, item in enumerate(completion.items)
    ]
    return lsp.CompletionList(is_incomplete=False, items=items)


async def hover(server: Server, params: lsp.HoverParams) -> lsp.Hover | None:
    """Markdown about the thing under the cursor."""
    analysis = server.analysis(params.text_document.uri)
    positions = server.positions(analysis.source)
    offset = _offset(positions, params.position)
    hovered = await server.off_loop(lambda: explaining.explain(analysis, offset))
    if hovered is None:
        return None
    text, start, end = hovered
    return lsp.Hover(lsp.MarkupContent(lsp.MarkupKind.Markdown, text), _range(positions, start, end))


async def definition(server: Server, params: lsp.DefinitionParams) -> lsp.Location | None:
    """The declaration of the name under the cursor, in this file or in a library."""
    analysis = server.analysis(params.text_document.uri)
    positions = server.positions(analysis.source)
    offset = _offset(positions, params.position)

    def find() -> lsp.Location | None:
        occurrence = analysis.names.at(offset)
        place = analysis.declaration(occurrence) if occurrence is not None else None
        if place is None:
            return None
        path, start, end = place
        if path == analysis.source.path:
            return lsp.Location(params.text_document.uri, _range(positions, start, end))
        other = library_file(path)
        return lsp.Location(_uri(path), _range(server.positions(other.source), start, end)) if other else None

    return await server.off_loop(find)


async def references(server: Server, params: lsp.ReferenceParams) -> list[lsp.Location]:
    """Every place in the file with the same meaning as the name under the cursor."""
    analysis = server.analysis(params.text_document.uri)
    positions = server.positions(analysis.source)
    occurrence = await server.off_loop(lambda: analysis.names.at(_offset(positions, params.position)))
    occurrences = analysis.names.of(occurrence.key) if occurrence is not None else []
    wanted = [place for place in occurrences if params.context.include_declaration or not place.declares]
    return [lsp.Location(params.text_document.uri, _range(positions, p.start, p.end)) for p in wanted]


async def highlight(server: Server, params: lsp.DocumentHighlightParams) -> list[lsp.DocumentHighlight]:
    """Every place in the file with the same meaning as the name under the cursor, for highlighting."""
    analysis = server.analysis(params.text_document.uri)
    positions = server.positions(analysis.source)
    occurrence = await server.off_loop(lambda: analysis.names.at(_offset(positions, params.position)))
    occurrences = analysis.names.of(occurrence.key) if occurrence is not None else []
    return [lsp.DocumentHighlight(_range(positions, place.start, place.end)) for place in occurrences]


async def prepare_rename(server: Server, params: lsp.PrepareRenameParams) -> lsp.Range:
    """The extent of the name to change. Responds with an error that gives the reason if there is none."""
    analysis = server.analysis(params.text_document.uri)
    positions = server.positions(analysis.source)
    offset = _offset(positions, params.position)
    occurrence = await server.off_loop(lambda: _refusable(lambda: renaming.renamable(analysis, offset)))
    return _range(positions, occurrence.start, occurrence.end)


async def rename(server: Server, params: lsp.RenameParams) -> lsp.WorkspaceEdit:
    """The edits of a renaming. Responds with an error that gives the reason if it is impossible."""
    analysis = server.analysis(params.text_document.uri)
    positions = server.positions(analysis.source)
    offset = _offset(positions, params.position)
    places = await server.off_loop(lambda: _refusable(lambda: renaming.rename(analysis, offset, params.new_name)))
    edits = [lsp.TextEdit(_range(positions, place.start, place.end), params.new_name) for place in places]
    return lsp.WorkspaceEdit(changes={params.text_document.uri: edits})


async def symbols(server: Server, params: lsp.DocumentSymbolParams) -> list[lsp.DocumentSymbol]:
    """The declarations of the file."""
    analysis = server.analysis(params.text_document.uri)
    positions = server.positions(analysis.source)
    return await server.off_loop(lambda: _symbols(outlining.outline(analysis.tree), positions))


async def formatting(server: Server, params: lsp.DocumentFormattingParams) -> list[lsp.TextEdit] | None:
    """The formatted text as one edit; None if it has syntax errors or is formatted already."""
    analysis = server.analysis(params.text_document.uri)
    source = analysis.source
    formatted = await server.off_loop(lambda: format_source(source))
    if formatted.text is None or formatted.text == source.text:
        return None
    positions = server.positions(source)
    return [lsp.TextEdit(_range(positions, 0, len(source.text)), formatted.text)]


async def actions(server: Server, params: lsp.CodeActionParams) -> list[lsp.CodeAction]:
    """The fixes of the diagnostics that touch the selection."""
    analysis = server.analysis(params.text_document.uri)
    positions = server.positions(analysis.source)
    begin, end = _offset(positions, params.range.start), _offset(positions, params.range.end)
    diagnostics = await server.off_loop(lambda: analysis.diagnostics)
    code_actions: list[lsp.CodeAction] = []
    for diagnostic in diagnostics:
        if diagnostic.fix is not None and diagnostic.span.start <= end and begin <= diagnostic.span.end:
            shown = server.diagnostic(diagnostic, positions, analysis.source.path)
            edits = {params.text_document.uri: [_edit(edit, positions) for edit in diagnostic.fix.edits]}
            code_actions.append(_action(diagnostic.fix, shown, lsp.WorkspaceEdit(changes=edits)))
    return code_actions


async def signature_help(server: Server, params: lsp.SignatureHelpParams) -> lsp.SignatureHelp | None:
    """The signature of the call around the cursor, with the argument at the cursor."""
    analysis = server.analysis(params.text_document.uri)
    offset = _offset(server.positions(analysis.source), params.position)
    known = await server.off_loop(lambda: signatures.signature_at(analysis, offset))
    if known is None:
        return None
    parameters = [lsp.ParameterInformation(label=place) for place in known.parameters]
    shown = lsp.SignatureInformation(known.label, known.doc or None, parameters, known.active)
    return lsp.SignatureHelp([shown], active_signature=0, active_parameter=known.active)


async def semantic_tokens(server: Server, params: lsp.SemanticTokensParams) -> lsp.SemanticTokens:
    """The kind of every word, as distances to the token before (the protocol's encoding)."""
    analysis = server.analysis(params.text_document.uri)
    positions = server.positions(analysis.source)
    return lsp.SemanticTokens(await server.off_loop(lambda: _encoded(colours.coloured(analysis), positions)))


async def folding(server: Server, params: lsp.FoldingRangeParams) -> list[lsp.FoldingRange]:
    """The parts that can be folded."""
    analysis = server.analysis(params.text_document.uri)
    ranges = await server.off_loop(lambda: folds(analysis))
    return [lsp.FoldingRange(fold.first - 1, fold.last - 1, kind=lsp.FoldingRangeKind(fold.kind)) for fold in ranges]


async def inlay_hints(server: Server, params: lsp.InlayHintParams) -> list[lsp.InlayHint]:
    """The hints for units in a part of the text."""
    analysis = server.analysis(params.text_document.uri)
    positions = server.positions(analysis.source)
    start, end = _offset(positions, params.range.start), _offset(positions, params.range.end)
    hints = await server.off_loop(lambda: unit_hints(analysis, start, end))
    shown = []
    for hint in hints:
        place = positions.place(hint.offset)
        at = lsp.Position(place.line, place.character)
        shown.append(lsp.InlayHint(at, hint.label, lsp.InlayHintKind.Type, tooltip=hint.tooltip))
    return shown


_FEATURES: tuple[tuple[str, Callable[..., object], object], ...] = (
    (lsp.TEXT_DOCUMENT_DID_OPEN, opened, None),
    (lsp.TEXT_DOCUMENT_DID_CHANGE, changed, None),
    (lsp.TEXT_DOCUMENT_DID_CLOSE, closed, None),
    (lsp.TEXT_DOCUMENT_DID_SAVE, saved, None),
    (lsp.SHUTDOWN, ended, None),
    (lsp.TEXT_DOCUMENT_COMPLETION, complete, lsp.CompletionOptions(trigger_characters=[".", ":", "~", " "])),
    (lsp.TEXT_DOCUMENT_HOVER, hover, None),
    (lsp.TEXT_DOCUMENT_DEFINITION, definition, None),
    (lsp.TEXT_DOCUMENT_REFERENCES, references, None),
    (lsp.TEXT_DOCUMENT_DOCUMENT_HIGHLIGHT, highlight, None),
    (lsp.TEXT_DOCUMENT_PREPARE_RENAME, prepare_rename, None),
    (lsp.TEXT_DOCUMENT_RENAME, rename, lsp.RenameOptions(prepare_provider=True)),
    (lsp.TEXT_DOCUMENT_DOCUMENT_SYMBOL, symbols, None),
    (lsp.TEXT_DOCUMENT_FORMATTING, formatting, None),
    (
        lsp.TEXT_DOCUMENT_SIGNATURE_HELP,
        signature_help,
        lsp.SignatureHelpOptions(trigger_characters=["(", ","], retrigger_characters=[","]),
    ),
    (
        lsp.TEXT_DOCUMENT_SEMANTIC_TOKENS_FULL,
        semantic_tokens,
        lsp.SemanticTokensLegend(token_types=list(colours.KINDS), token_modifiers=[]),
    ),
    (lsp.TEXT_DOCUMENT_FOLDING_RANGE, folding, None),
    (lsp.TEXT_DOCUMENT_INLAY_HINT, inlay_hints, None),
    (
        lsp.TEXT_DOCUMENT_CODE_ACTION,
        actions,
        lsp.CodeActionOptions(code_action_kinds=[lsp.CodeActionKind.QuickFix]),
    ),
)
"""Every feature with its handler and its options."""


# -- conversions


def _range(positions: Positions, start: int, end: int) -> lsp.Range:
    first, last = positions.place(start), positions.place(end)
    return lsp.Range(lsp.Position(first.line, first.character), lsp.Position(last.line, last.character))


def _offset(positions: Positions, place: lsp.Position) -> int:
    return positions.offset(TextPosition(place.line, place.character))


def _edit(edit: Edit, positions: Positions) -> lsp.TextEdit:
    return lsp.TextEdit(_range(positions, edit.span.start, edit.span.end), edit.text)


def _action(fix: Fix, diagnostic: lsp.Diagnostic, edit: lsp.WorkspaceEdit) -> lsp.CodeAction:
    return lsp.CodeAction(
        title=fix.title,
        kind=lsp.CodeActionKind.QuickFix,
        diagnostics=[diagnostic],
        is_preferred=fix.safe,
        edit=edit,
    )


def _encoded(tokens: Iterable[colours.ColouredToken], positions: Positions) -> list[int]:
    """Five numbers for each token: lines and columns since the token before, length, kind, and no modifiers."""
    data: list[int] = []
    line = column = 0
    for token in tokens:
        start, end = positions.place(token.start), positions.place(token.end)
        between = start.character - (column if start.line == line else 0)
        data += [start.line - line, between, end.character - start.character, colours.KINDS.index(token.kind), 0]
        line, column = start.line, start.character
    return data


def _symbols(entries: Iterable[outlining.OutlineEntry], positions: Positions) -> list[lsp.DocumentSymbol]:
    return [
        lsp.DocumentSymbol(
            name=entry.name,
            kind=_SYMBOL_KINDS.get(entry.keyword, lsp.SymbolKind.Field),
            range=_range(positions, entry.start, entry.end),
            selection_range=_range(positions, entry.name_start, entry.name_end),
            detail=f"{entry.keyword} {entry.detail}".strip(),
            children=_symbols(entry.children, positions),
        )
        for entry in entries
    ]


def _refusable(work: Callable[[], T]) -> T:
    try:
        return work()
    except LingjingError as error:
        raise JsonRpcInvalidParams(str(error)) from None


def _path(uri: str) -> str:
    """The file's path, or a name in angle brackets for an unsaved text."""
    parts = urlsplit(uri)
    if parts.scheme != "file":
        return f"<{Path(unquote(parts.path)).name or 'untitled'}>"
    return uris.to_fs_path(uri) or f"<{uri}>"


def _uri(path: str) -> str:
    return uris.from_fs_path(path) or path
