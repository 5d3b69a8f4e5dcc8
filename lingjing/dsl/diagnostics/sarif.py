"""Diagnostics as SARIF 2.1.0 (OASIS, errata 01): one run, one rule for each code, one result for each diagnostic.

Columns count characters (`unicodeCodePoints`), as everywhere in this project. Paths are relative URI references with
`/`, so that a viewer resolves them against the working folder of the command.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import msgspec

from lingjing.dsl.diagnostics.codes import CODES
from lingjing.mission.diagnostics import Diagnostic, Fix, Span

SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
_LEVELS = {"error": "error", "warning": "warning", "note": "note"}


def render_sarif(diagnostics: Iterable[Diagnostic], version: str) -> str:
    """The log as JSON text with a newline at its end. `version`: version of the tool."""
    items = tuple(diagnostics)
    codes = sorted({item.code for item in items})
    log = {
        "$schema": SCHEMA,
        "version": "2.1.0",
        "runs": [
            {
                "tool": {
                    "driver": {
                        "name": "lingjing",
                        "semanticVersion": version,
                        "rules": [_rule(code) for code in codes],
                    }
                },
                "columnKind": "unicodeCodePoints",
                "results": [_result(item, codes.index(item.code)) for item in items],
            }
        ],
    }
    return msgspec.json.format(msgspec.json.encode(log), indent=2).decode() + "\n"


def _rule(code: str) -> dict[str, Any]:
    return {
        "id": code,
        "shortDescription": {"text": CODES.get(code, code)},
        "help": {"text": f"`lingjing explain {code}` explains this error and its correction."},
        "defaultConfiguration": {"level": "error"},
    }


def _result(item: Diagnostic, rule: int) -> dict[str, Any]:
    text = f"{item.message} ({item.hint})" if item.hint else item.message
    result: dict[str, Any] = {
        "ruleId": item.code,
        "ruleIndex": rule,
        "level": _LEVELS[item.severity],
        "message": {"text": text},
        "locations": [_location(item.span)],
    }
    if item.related:
        result["relatedLocations"] = [
            {"id": number, **_location(related.span), "message": {"text": related.message}}
            for number, related in enumerate(item.related, 1)
        ]
    if item.fix is not None:
        result["fixes"] = [_fix(item.fix)]
    return result


def _fix(fix: Fix) -> dict[str, Any]:
    """A fix. All of its edits are in one file."""
    replacements = [{"deletedRegion": _region(edit.span), "insertedContent": {"text": edit.text}} for edit in fix.edits]
    artifact = {"artifactLocation": {"uri": _uri(fix.edits[0].span.path)}, "replacements": replacements}
    safety = "safe" if fix.safe else "check it: it may not be the intended text"
    return {"description": {"text": f"{fix.title} ({safety})"}, "artifactChanges": [artifact]}


def _location(span: Span) -> dict[str, Any]:
    return {"physicalLocation": {"artifactLocation": {"uri": _uri(span.path)}, "region": _region(span)}}


def _region(span: Span) -> dict[str, int]:
    return {
        "startLine": span.line,
        "startColumn": span.column,
        "endLine": span.end_line,
        "endColumn": span.end_column,
        "charOffset": span.start,
        "charLength": span.end - span.start,
    }


def _uri(path: str) -> str:
    """The path as a URI (RFC 3986): special characters are percent-encoded; an absolute path becomes a `file` URI."""
    from urllib.parse import quote

    plain = quote(path.replace("\\", "/").encode("utf-8", "surrogateescape"))
    if path.startswith("/"):
        return f"file://{plain}"
    return plain.removeprefix("./") or "."
