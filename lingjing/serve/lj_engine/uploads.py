"""Pictures that come as multipart/form-data over HTTP, and the pictures that are awaited."""

from __future__ import annotations

import hashlib
import io
import secrets
import threading
from email.parser import BytesParser
from email.policy import HTTP
from http import HTTPStatus
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

UPLOAD_PATH = "/sim/vision/upload"
"""The path of the paper's backend."""
MOST_BYTES = 32 * 2**20
"""Longest body of an upload, bytes (chosen: a PNG of 4096 by 4096 pixels has less)."""
_MOST_FIELDS = 64
_MOST_FIELD_BYTES = 64 * 1024
_MOST_PIXELS = 4096 * 4096
_FILE_FIELD = "file"
_FORMATS = ("JPEG", "PNG", "BMP")


class UploadError(Exception):
    """An upload that is refused."""

    def __init__(self, status: HTTPStatus, message: str) -> None:
        super().__init__(message)
        self.status, self.message = status, message


class Upload(NamedTuple):
    """A picture that has arrived."""

    fields: dict[str, str]
    rgb: npt.NDArray[np.uint8]
    """(height, width, 3)."""
    sha256: str
    """SHA-256 (hex) of the file."""


def read_upload(content_type: str, body: bytes) -> Upload:
    """Return the picture of a request's body. Raises `UploadError`."""
    if not content_type.lower().startswith("multipart/form-data"):
        raise UploadError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "an upload must be multipart/form-data")
    if not content_type.isascii() or not content_type.isprintable():
        raise UploadError(HTTPStatus.BAD_REQUEST, "the Content-Type is malformed")
    head = f"MIME-Version: 1.0\r\nContent-Type: {content_type}\r\n\r\n".encode()
    message = BytesParser(policy=HTTP).parsebytes(head + body)
    if not message.is_multipart():
        raise UploadError(HTTPStatus.BAD_REQUEST, "the body has no parts between boundaries")
    fields: dict[str, str] = {}
    file: bytes | None = None
    for number, part in enumerate(message.iter_parts()):
        if number >= _MOST_FIELDS:
            raise UploadError(HTTPStatus.BAD_REQUEST, f"an upload may have at most {_MOST_FIELDS} fields")
        name = part.get_param("name", header="content-disposition")
        content = part.get_payload(decode=True)
        if not isinstance(name, str) or not isinstance(content, bytes):
            raise UploadError(HTTPStatus.BAD_REQUEST, "a part has no name or no content")
        filename = part.get_filename()
        if filename is not None or name == _FILE_FIELD:
            if file is not None:
                raise UploadError(HTTPStatus.BAD_REQUEST, "an upload must have one file")
            _check_name(filename or "")
            file = content
        elif len(content) > _MOST_FIELD_BYTES:
            raise UploadError(HTTPStatus.BAD_REQUEST, f"the field `{name[:40]}` is too long")
        else:
            fields[name] = content.decode("utf-8", "replace")
    if file is None:
        raise UploadError(HTTPStatus.BAD_REQUEST, f"the field `{_FILE_FIELD}` with the picture is missing")
    return Upload(fields, _pixels(file), hashlib.sha256(file).hexdigest())


def _check_name(filename: str) -> None:
    """Refuse a path: names decide nothing here, and a client that sends one means to write elsewhere."""
    if any(mark in filename for mark in ("/", "\\", ":", "\0", "..")):
        raise UploadError(HTTPStatus.BAD_REQUEST, "the file's name is a path; only a plain name is taken")


def _pixels(file: bytes) -> npt.NDArray[np.uint8]:
    import PIL.Image

    try:
        image = PIL.Image.open(io.BytesIO(file), formats=_FORMATS)
        if image.width * image.height > _MOST_PIXELS:
            raise UploadError(HTTPStatus.BAD_REQUEST, f"the picture has more than {_MOST_PIXELS} pixels")
        return np.array(image.convert("RGB"))
    except UploadError:
        raise
    except Exception as error:
        raise UploadError(HTTPStatus.BAD_REQUEST, f"the file is no picture of {', '.join(_FORMATS)}") from error


class AwaitedPictures:
    """The pictures that were requested and have not arrived. Its methods are thread-safe."""

    def __init__(self) -> None:
        self._arrived: dict[str, Upload | None] = {}
        self._news = threading.Condition()

    def expect(self, frame: str) -> str:
        """Return the photoid under which a picture is awaited. It cannot be guessed."""
        photo = f"{''.join(letter if letter.isalnum() else '-' for letter in frame)}-{secrets.token_hex(8)}"
        with self._news:
            self._arrived[photo] = None
        return photo

    def arrive(self, upload: Upload) -> str:
        """Take an upload over and return its photoid. Raises `UploadError` if it is not awaited."""
        photo = upload.fields.get("photoid", "")
        with self._news:
            if photo not in self._arrived:
                raise UploadError(HTTPStatus.NOT_FOUND, "no picture with this photoid is awaited")
            if self._arrived[photo] is not None:
                raise UploadError(HTTPStatus.CONFLICT, "this picture has arrived already")
            self._arrived[photo] = upload
            self._news.notify_all()
        return photo

    def take(self, photo: str, deadline_s: float) -> Upload | None:
        """Wait for a picture and return it; None after the deadline. Later uploads of it are refused."""
        with self._news:
            self._news.wait_for(lambda: self._arrived.get(photo) is not None, deadline_s)
            return self._arrived.pop(photo, None)
