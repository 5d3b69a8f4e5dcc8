"""The upload of a picture to a backend."""

from __future__ import annotations

import urllib.error
import urllib.request
import uuid
from collections.abc import Callable, Mapping
from urllib.parse import urlsplit

_UPLOAD_S = 10.0
"""Time-out of an upload, seconds (chosen)."""


def post_picture(
    url: str, field: str, form: Mapping[str, str], jpeg: bytes, *, allowed_host: str, say: Callable[[str], None]
) -> bool:
    """Post a picture to the backend, and to no other host: a backend must not use this machine to reach others."""
    parts = urlsplit(url)
    if parts.scheme not in ("http", "https") or parts.hostname != allowed_host:
        say(f"no upload to {url[:100]}: pictures go to the backend at {allowed_host} alone")
        return False
    body, content_type = multipart(form, field, jpeg)
    request = urllib.request.Request(url, body, {"Content-Type": content_type})  # noqa: S310 - checked above
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}), _NoRedirect())
    try:
        with opener.open(request, timeout=_UPLOAD_S) as response:
            return 200 <= int(response.status) < 300
    except (urllib.error.URLError, OSError, ValueError) as error:
        say(f"the upload failed: {error}")
        return False


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """Follows no redirection: it could lead to another host."""

    def redirect_request(self, *arguments: object) -> None:
        """Follow no redirection."""
        return


def multipart(form: Mapping[str, str], field: str, jpeg: bytes) -> tuple[bytes, str]:
    """Return the body and the Content-Type of an upload."""
    boundary = f"lingjing{uuid.uuid4().hex}"
    parts = []
    for name, value in form.items():
        head = f'--{boundary}\r\nContent-Disposition: form-data; name="{_quoted(name)}"\r\n\r\n'
        parts.append(head.encode() + value.encode() + b"\r\n")
    file = f'--{boundary}\r\nContent-Disposition: form-data; name="{_quoted(field)}"; filename="picture.jpg"\r\n'
    parts.append(file.encode() + b"Content-Type: image/jpeg\r\n\r\n" + jpeg + b"\r\n")
    parts.append(f"--{boundary}--\r\n".encode())
    return b"".join(parts), f"multipart/form-data; boundary={boundary}"


def _quoted(name: str) -> str:
    return name.replace('"', "%22").replace("\r", "").replace("\n", "")
