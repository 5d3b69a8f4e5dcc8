"""`SourceText`: the text of one file, with the conversion of offsets to lines and columns."""

from __future__ import annotations

import os
from bisect import bisect_right
from typing import TYPE_CHECKING

from lingjing.errors import UsageError
from lingjing.file_names import check_name
from lingjing.mission.diagnostics import Span

if TYPE_CHECKING:
    from typing import BinaryIO

LONGEST_LINE = 1_000_000
"""Most characters of a line (chosen): no author writes longer ones, and the limit bounds the memory of every phase."""

LARGEST_FILE = 32_000_000
"""Most bytes of a file (chosen): about fifteen times the largest mission in the project's measurements."""

_LARGEST = f"a mission has at most {LARGEST_FILE // 1_000_000} MB"


class SourceText:
    """One text. Lines end with LF, CRLF or CR; a byte-order mark is dropped; offsets count characters of `text`."""

    __slots__ = ("_line_starts", "path", "text")

    def __init__(self, text: str, path: str = "<string>") -> None:
        self.text = text.removeprefix("\ufeff")
        self.path = path
        self._line_starts: list[int] | None = None

    def line_of(self, offset: int) -> int:
        """The line of an offset, counted from 1."""
        return bisect_right(self.line_starts(), offset)

    def line_text(self, line: int) -> str:
        """The text of a line (counted from 1) without its end; empty after the last line."""
        starts = self.line_starts()
        if not 1 <= line <= len(starts):
            return ""
        end = starts[line] if line < len(starts) else len(self.text)
        return self.text[starts[line - 1] : end].rstrip("\r\n")

    def span(self, start: int, end: int) -> Span:
        """The span of the characters from `start` to `end`, `end` excluded."""
        line, end_line = self.line_of(start), self.line_of(end)
        starts = self.line_starts()
        return Span(
            path=self.path,
            start=start,
            end=end,
            line=line,
            column=start - starts[line - 1] + 1,
            end_line=end_line,
            end_column=end - starts[end_line - 1] + 1,
        )

    def line_starts(self) -> list[int]:
        """The offsets at which lines begin."""
        if self._line_starts is None:
            self._line_starts = _line_starts(self.text)
        return self._line_starts


class JoinedSource(SourceText):
    """A mission's text, followed by the texts of the missions that it extends. Offsets count through all of them.

    Spans refer to the original files. `place` is the span of the base's name in the mission. Errors inside a base are
    reported there, because the author can change that file.
    """

    __slots__ = ("_parts", "own", "place")

    def __init__(self, own: SourceText, start: int, end: int) -> None:
        super().__init__(own.text, own.path)
        self.own = own
        self.place = own.span(start, end)
        self._parts: list[tuple[int, SourceText]] = []

    def append(self, part: SourceText) -> int:
        """Append a base's text and return its first offset."""
        start = len(self.text) + 1
        self.text = f"{self.text}\n{part.text}"
        self._parts.append((start, part))
        return start

    def span(self, start: int, end: int) -> Span:
        """The span in the file that the text comes from."""
        return self.inner(start, end) or self.own.span(start, end)

    def inner(self, start: int, end: int) -> Span | None:
        """The span in a base's file; None if the offsets are in the mission's own text."""
        for begin, part in reversed(self._parts):
            if start >= begin:
                return part.span(start - begin, max(start, end) - begin)
        return None


def _line_starts(text: str) -> list[int]:
    starts = [0]
    find = text.find
    if "\r" not in text:
        at = find("\n")
        while at >= 0:
            starts.append(at + 1)
            at = find("\n", at + 1)
        return starts
    for at, character in enumerate(text):
        if character == "\n" or (character == "\r" and text[at + 1 : at + 2] != "\n"):
            starts.append(at + 1)
    return starts


def read_stream(file: BinaryIO, path: str) -> SourceText:
    """Read a stream of unknown size, such as standard input. Errors are those of `read_source`."""
    return decode_source(_bounded(file, path), path)


def _bounded(file: BinaryIO, path: str) -> bytes:
    data = file.read(LARGEST_FILE + 1)
    if len(data) > LARGEST_FILE:
        raise UsageError(f"`{path}` does not end within {LARGEST_FILE // 1_000_000} MB", hint=_LARGEST)
    return data


def read_source(path: str) -> SourceText:
    """Read a file.

    Raises `UsageError` with the reason if it cannot be read: missing, a folder, not text, too large, or an invalid
    name.
    """
    check_name(path, "file")
    try:
        with open(path, "rb") as file:  # noqa: PTH123 - pathlib costs a tenth of the cold start
            size = os.fstat(file.fileno()).st_size
            if size > LARGEST_FILE:
                raise UsageError(f"`{path}` has {size / 1e6:.1f} MB", hint=_LARGEST)
            data = _bounded(file, path)
    except FileNotFoundError:
        raise UsageError(f"`{path}` does not exist", hint="check the spelling and the working folder") from None
    except IsADirectoryError:
        raise UsageError(f"`{path}` is a folder", hint="name a .ljs or .json file in it") from None
    except OSError as error:
        raise UsageError(f"`{path}` cannot be read: {error.strerror}") from None
    except ValueError:
        raise UsageError(f"`{path!r}` is not a file name") from None
    return decode_source(data, path)


def decode_source(data: bytes, path: str) -> SourceText:
    """Decode the bytes of a file. Raises `UsageError` if they are not UTF-8 (with the byte's offset) or a line is too
    long.
    """
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise UsageError(
            f"`{path}` is not UTF-8: byte {data[error.start]:#04x} at offset {error.start}", hint=_encoding_hint(data)
        ) from None
    longest, at = longest_line(text)
    if longest > LONGEST_LINE:
        raise UsageError(
            f"`{path}` has a line of {longest:,} characters at line {text.count(chr(10), 0, at) + 1}",
            hint=f"a line has at most {LONGEST_LINE:,} characters; break it after commas",
        )
    return SourceText(text, path)


def longest_line(text: str) -> tuple[int, int]:
    """Length and offset of the longest line. The search stops at the first line beyond the limit."""
    start, best, best_at = 0, 0, 0
    while start <= len(text):
        end = text.find("\n", start)
        end = len(text) if end < 0 else end
        if end - start > best:
            best, best_at = end - start, start
            if best > LONGEST_LINE:
                break
        start = end + 1
    return best, best_at


def _encoding_hint(data: bytes) -> str:
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "it looks like UTF-16; save it as UTF-8"
    if b"\0" in data[:4096]:
        return "it looks like a binary file; a mission is text"
    return "save it as UTF-8"
