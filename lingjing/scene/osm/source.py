"""The bytes of a map file: recognition of compression and format, and the uncompressed stream.

The content decides, never the name: a map may be called `interpreter`, or end in `.osm` though it is compressed. A file
in another format is rejected with that format's name and advice how to get a map from it.
"""

from __future__ import annotations

import bz2
import gzip
import re
import zlib
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Literal, cast

from lingjing.errors import UsageError

STRETCH = 100
"""Most times its own size that a map may unpack to (chosen): map XML shrinks to 1/10 or 1/20, zip bombs to 1/1000."""

HINT = "give the map as it was downloaded (.osm, .osm.gz, .osm.bz2 or .osm.pbf)"
OVERPASS_HINT = "ask Overpass for `[out:xml]` instead of `[out:json]`, with `(._;>;); out;` at the end"

_WINDOW = 64 << 20
"""Unpacked bytes between two checks of `STRETCH`."""
_CHUNK = 1 << 18
"""Bytes of one read. Chosen."""
_HEAD = 1 << 16
"""Bytes at the beginning by which a format is recognised."""

Packing = Literal["", "gzip", "bzip2"]
Encoding = Literal["xml", "pbf"]

_PACKED: tuple[tuple[bytes, Packing], ...] = ((b"\x1f\x8b", "gzip"), (b"BZh", "bzip2"))
_MARKS: tuple[tuple[bytes, str, str], ...] = (
    (b"PK\x03\x04", "a zip archive", "unpack it first"),
    (b"\xfd7zXZ\x00", "packed with xz", "unpack it first: unxz FILE"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", "unpack it first"),
    (b"\x28\xb5\x2f\xfd", "packed with zstd", "unpack it first: unzstd FILE"),
    (b"\xff\xe0\x04o5m2", "OpenStreetMap data as o5m", "convert it: osmium cat FILE.o5m -o FILE.osm.pbf"),
    (b"SQLite format 3\x00", "an SQLite database (GeoPackage, MBTiles)", HINT),
    (b"\x00\x00\x27\x0a", "an ESRI shapefile", "download the place's OpenStreetMap data instead (.osm or .osm.pbf)"),
    (b"%PDF-", "a PDF document", HINT),
    (b"\x89PNG", "a picture", HINT),
    (b"\xff\xd8\xff", "a picture", HINT),
    (b"version https://git-lfs", "a Git LFS pointer, the map itself is elsewhere", "fetch it: git lfs pull"),
)
"""First bytes of files that are no maps, the format, and advice."""

_BRACKETED: tuple[tuple[bytes, str, str], ...] = (
    (rb"\A\s*\[\s*(?:out|timeout|maxsize|bbox)\s*:", "a query to Overpass", "send it to Overpass and give the answer"),
    (rb'"(?:elements|osm3s)"\s*:', "OpenStreetMap data as Overpass JSON", OVERPASS_HINT),
    (rb'"CityJSON"', "CityJSON", "download the place's OpenStreetMap data instead (.osm or .osm.pbf)"),
    (rb'"Topology"', "TopoJSON", "download the place's OpenStreetMap data instead (.osm or .osm.pbf)"),
    (
        rb'"(?:FeatureCollection|Feature|GeometryCollection)"',
        "GeoJSON",
        "GeoJSON has lost the nodes that streets share: download the place's OpenStreetMap data (.osm or .osm.pbf)",
    ),
)
"""Texts that begin with a bracket: a pattern, the format, and advice."""

_PAGE = re.compile(rb"(?>\s+|<\?xml[^>]*>|<!--.*?-->)*+(?:<!doctype\s+html|<html[\s>])", re.IGNORECASE | re.DOTALL)
"""The beginning of a web page. The possessive quantifier prevents exponential backtracking on blanks and comments."""

_TITLE = re.compile(rb"<title[^>]*>(.*?)</title>", re.IGNORECASE | re.DOTALL)
_ERROR = re.compile(rb"</strong>\s*:\s*([^<]{1,200})")
"""The sentence in which an error page of Overpass states the error."""

_OPL = re.compile(rb"[nwr]-?\d+ [vdctiuTxyNM]")
_PBF = re.compile(rb"\x00\x00..\x0a\x09OSMHeader", re.DOTALL)


@dataclass(frozen=True, slots=True)
class MapFile:
    """A file that was recognised as a map."""

    path: Path
    packing: Packing
    encoding: Encoding

    def chunks(self) -> Generator[bytes, None, None]:
        """Yield the uncompressed bytes. Raises `UsageError` if they are damaged, or far more than a map has."""
        try:
            with self.path.open("rb") as file, closing(_plain(file, self.packing)) as plain:
                position = count = 0
                while chunk := plain.read(_CHUNK):
                    yield chunk
                    count += len(chunk)
                    if self.packing and count >= _WINDOW:
                        if count > STRETCH * (file.tell() - position):
                            raise bomb(self.path, f"it unpacks to more than {STRETCH} times its size")
                        position, count = file.tell(), 0
        except (OSError, EOFError, zlib.error) as error:
            why = (isinstance(error, OSError) and error.strerror) or str(error)
            problem = "is not OpenStreetMap data, it cannot be unpacked" if self.packing else "cannot be read"
            hint = "the download was cut off: download the map again" if isinstance(error, EOFError) else HINT
            raise UsageError(f"`{self.path}` {problem}: {why}", hint=hint) from None


def recognise(path: Path) -> MapFile:
    """Recognise the format of a file. Raises `UsageError` if it is missing, empty or of a known other format."""
    head = _head(path)
    packing: Packing = next((packing for mark, packing in _PACKED if head.startswith(mark)), "")
    if packing:
        head = _unpacked_head(path, packing)
        if any(head.startswith(mark) for mark, _ in _PACKED):
            raise UsageError(f"`{path}` was packed twice", hint="unpack it once first: gunzip FILE, or bunzip2 FILE")
    if _PBF.match(head):
        if packing:
            raise UsageError(f"`{path}` is a .pbf that was packed once more", hint="unpack it first: gunzip FILE")
        return MapFile(path, packing, "pbf")
    _refuse_foreign(path, head)
    return MapFile(path, packing, "xml")


def bomb(path: Path, why: str) -> UsageError:
    """The error for a file that unpacks to an implausible size."""
    return UsageError(f"`{path}` is no map: {why}", hint=HINT)


# -- private


def _head(path: Path) -> bytes:
    if path.is_dir():
        raise UsageError(f"`{path}` is a folder, not a map", hint="name an .osm or .osm.pbf file")
    if not path.is_file():
        why = "it is no regular file" if path.exists() else "the file does not exist"
        raise UsageError(f"no map at `{path}`: {why}", hint="a path begins in the working folder")
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise UsageError(f"cannot read `{path}`: {error.strerror}") from None
    if not head:
        raise UsageError(f"`{path}` is empty: 0 bytes", hint="download the map again")
    return head


def _unpacked_head(path: Path, packing: Packing) -> bytes:
    with closing(MapFile(path, packing, "xml").chunks()) as chunks:
        head = next(chunks, b"")
    if not head:
        raise UsageError(f"`{path}` is empty: it unpacks to 0 bytes", hint="download the map again")
    return head


def _plain(file: IO[bytes], packing: Packing) -> IO[bytes]:
    if packing == "gzip":
        return cast("IO[bytes]", gzip.GzipFile(fileobj=file))
    return cast("IO[bytes]", bz2.BZ2File(file)) if packing else file


def _refuse_foreign(path: Path, head: bytes) -> None:
    for mark, kind, hint in _MARKS:
        if head.startswith(mark):
            raise UsageError(f"`{path}` is not OpenStreetMap data: it is {kind}", hint=hint)
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    if text.startswith((b"{", b"[")):
        kind_and_hint = next(((kind, hint) for mark, kind, hint in _BRACKETED if re.search(mark, head)), ("JSON", HINT))
        raise UsageError(f"`{path}` is no map in XML or PBF: it is {kind_and_hint[0]}", hint=kind_and_hint[1])
    if _PAGE.match(text):
        raise _web_page(path, head)
    if _OPL.match(text):
        raise UsageError(
            f"`{path}` is no map in XML or PBF: it is OpenStreetMap data as OPL",
            hint="convert it: osmium cat FILE.osm.opl -o FILE.osm.pbf",
        )
    if b"<" not in text[:_HEAD]:
        raise UsageError(f"`{path}` is not OpenStreetMap data: {_beginning(text)}", hint=HINT)


def _beginning(text: bytes) -> str:
    """The first words of a text, or a statement that it is none."""
    words = " ".join(text[:40].decode("ascii", "replace").split())
    return f"it begins with `{words}`" if words.isascii() and words.isprintable() and words else "it is no text"


def _web_page(path: Path, head: bytes) -> UsageError:
    """The error for a web page: servers answer with one if they cannot deliver the map."""
    sentence = _ERROR.search(head) or _TITLE.search(head[:4096])
    words = " ".join(sentence[1].decode("utf-8", "replace").split())[:120] if sentence else ""
    title = f", `{words}`" if words.isprintable() and words else ""
    return UsageError(
        f"`{path}` is not OpenStreetMap data: it is a web page (HTML){title}",
        hint="the server answered with a page, perhaps an error: read it in a browser, then download the map again",
    )
