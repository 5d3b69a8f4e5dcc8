"""What a user may do about a service that refuses, as far as its status and its words tell."""

from __future__ import annotations

from lingjing.plugins.backbone import ModelError

_SPEAKING = ("model", "context", "token", "api key", "api_key", "quota", "credit", "billing")
"""A refusal that speaks of one of these says itself what is wrong: no guess is put beside it."""


def explained(error: ModelError, images: tuple[bytes, ...], schema: bytes | None) -> str:
    """The error and what to do about it."""
    way = remedy(error, images, schema)
    return f"{error} (try {way})" if way else str(error)


def remedy(error: ModelError, images: tuple[bytes, ...], schema: bytes | None) -> str:
    """What to do about a refusal, as far as its status and its words tell."""
    if error.status in (401, 403):
        return "another key: api_key_env=VARIABLE names it"
    if error.status == 404:
        return "another base_url or model"
    if error.status not in (400, 422):
        return ""
    text = str(error).lower().partition(": ")[2]  # what stands before is our own
    ways = [
        (bool(images), ("image", "vision", "multimodal"), "vision=no if the model takes no pictures"),
        (schema is not None, ("response_format", "schema", "grammar"), "schema=no if the service takes no JSON Schema"),
        (True, ("temperature",), "another temperature, or none"),
    ]
    named = [(there, way) for there, words, way in ways if any(word in text for word in words)]
    if named or any(word in text for word in _SPEAKING):
        return " or ".join(way for there, way in named if there)
    return " or ".join(way for there, _, way in ways[:2] if there)
