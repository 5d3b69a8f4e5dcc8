"""`junit_xml`: results of checks as JUnit XML, which the services of continuous integration show.

A file with missions is a `testsuite`, a check a `testcase`. A failed check has the child `failure`; one that cannot be
evaluated or was aborted has `error`, and one that was not run `skipped`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from xml.etree import ElementTree as ET

from lingjing.authoring.checks import MissionCheck
from lingjing.authoring.running import CheckResult

_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 cannot contain."""
_CHILDREN = {"failed": "failure", "error": "error", "aborted": "error"}


def junit_xml(
    results: Sequence[CheckResult], not_run: Iterable[MissionCheck] = (), broken: Iterable[tuple[str, str]] = ()
) -> bytes:
    """The document. `not_run`: checks without a result. `broken`: files with errors, and their messages."""
    root = ET.Element("testsuites")
    for file, message in broken:
        case = _case(_suite(root, file), file, "compiles", 0.0)
        _child(case, "error", "the mission has errors", message)
    for result in results:
        case = _case(_suite(root, result.check.file), result.check.file, result.check.text, result.wall_s)
        if result.state in _CHILDREN:
            _child(case, _CHILDREN[result.state], result.summary, "\n".join((result.summary, *result.details)))
    for check in not_run:
        _child(_case(_suite(root, check.file), check.file, check.text, 0.0), "skipped", "not run", "")
    for element in (*root, root):
        _count(element)
    ET.indent(root)
    document: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return document + b"\n"


def _suite(root: ET.Element, file: str) -> ET.Element:
    known = next((suite for suite in root if suite.get("name") == _plain(file)), None)
    return ET.SubElement(root, "testsuite", {"name": _plain(file)}) if known is None else known


def _case(suite: ET.Element, file: str, name: str, wall_s: float) -> ET.Element:
    attributes = {"classname": _plain(file), "name": _plain(name), "time": f"{wall_s:.3f}"}
    return ET.SubElement(suite, "testcase", attributes)


def _child(case: ET.Element, kind: str, message: str, text: str) -> None:
    ET.SubElement(case, kind, {"message": _plain(message)}).text = _plain(text) or None


def _count(element: ET.Element) -> None:
    cases = list(element.iter("testcase"))
    element.set("tests", str(len(cases)))
    for attribute, kind in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        element.set(attribute, str(sum(case.find(kind) is not None for case in cases)))
    element.set("time", f"{sum(float(case.get('time', '0')) for case in cases):.3f}")


def _plain(text: str) -> str:
    return _NO_XML.sub("\ufffd", text)
