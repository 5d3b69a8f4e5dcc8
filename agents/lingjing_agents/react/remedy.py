"""Advice about a service that rejects a request, from its status and its message."""

from __future__ import annotations

from lingjing.plugins.backbone import ModelError

_SPEAKING = ("model", "context", "token", "api key", "api_key", "quota", "credit", "billing")
"""Words of a rejection that states its cause: no advice is added to it."""


_TOO_LARGE = ("too large", "too big", "exceed", "larger than", "maximum size", "at most")
"""Words of services about pictures beyond their limits."""


def explained(error: ModelError, images: tuple[bytes, ...], schema: bytes | None) -> str:
    """Return the error with its remedy."""
    way = remedy(error, images, schema)
    return f"{error} (try {way})" if way else str(error)


def remedy(error: ModelError, images: tuple[bytes, ...], schema: bytes | None) -> str:
    """Return the remedy of a rejection, from its status and its message; "" if none is known."""
    if error.status in (401, 403):
        return "another key: api_key_env=VARIABLE names it"
    if error.status == 404:
        return "another base_url or model"
    if error.status not in (400, 413, 422):
        return ""
    text = str(error).lower().partition(": ")[2]  # the words before it are this package's
    if any(word in text for word in ("image", "picture", "payload")) and any(word in text for word in _TOO_LARGE):
        return "a smaller image_side or lower images, for all models that are compared"
    ways = [
        (bool(images), ("image", "vision", "multimodal"), "vision=no if the model takes no pictures"),
        (schema is not None, ("response_format", "schema", "grammar"), "schema=no if the service takes no JSON Schema"),
        (True, ("temperature",), "another temperature, or none"),
    ]
    named = [(there, way) for there, words, way in ways if any(word in text for word in words)]
    if named or any(word in text for word in _SPEAKING):
        return " or ".join(way for there, way in named if there)
    return " or ".join(way for there, _, way in ways[:2] if there)
