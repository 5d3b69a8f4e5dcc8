"""The options of `react`: what it is played with, and the client that they ask for."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from typing import Literal

from pydantic import ValidationInfo, field_validator

from lingjing.plugins.options import Field, PluginOptions
from lingjing_agents.llm.address import Address, address
from lingjing_agents.llm.capabilities import Capability, capability_of
from lingjing_agents.llm.chat import ModelClient
from lingjing_agents.llm.direct import DirectClient
from lingjing_agents.llm.guard import GuardedClient
from lingjing_agents.llm.redaction import Redactor
from lingjing_agents.llm.through_litellm import LitellmClient, load_litellm

_KEY_VARIABLES = ("_API_KEY", "_ACCESS_KEY", "_API_TOKEN", "_ACCESS_TOKEN", "_AUTH_TOKEN")
_LEAST_KEY_LETTERS = 16
_FOR_INSTANCE = "for instance http://localhost:8000/v1"

Switch = Literal["auto", "yes", "no"]


class ReactOptions(PluginOptions):
    """What `react` can be told. Options go into the trace, so a key, and an address with a password in it, are named
    by their environment variables."""

    model: str = Field(min_length=1, description="name of the model at its service")
    client: Literal["direct", "litellm"] = Field(
        "direct", description="how the service is spoken to: as an OpenAI-compatible server, or through litellm"
    )
    api_key_env: str = Field("", description="environment variable that holds the service's key")
    base_url_env: str = Field("", description="environment variable that holds the service's address")
    base_url: str = Field("", validate_default=True, description=f"the service's address, {_FOR_INSTANCE}")
    temperature: float = Field(0.0, ge=0.0, le=2.0, description="left out for models that take none, unless given")
    max_tokens: int = Field(2048, ge=16, le=1_000_000, description="the longest answer")
    deadline_s: float = Field(80.0, alias="deadline", ge=0.1, le=86_400.0, description="seconds for one decision")
    repairs: int = Field(2, ge=0, le=10, description="how often an answer that cannot be used is asked for again")
    tries: int = Field(5, ge=1, le=20, description="how often a call is tried that the service does not answer")
    history: int = Field(6, ge=0, le=1000, description="earlier ticks that the model is shown")
    image_side: int = Field(1280, ge=64, le=8192, description="the longer side of a picture, pixels")
    images: int = Field(2, ge=0, le=16, description="pictures a call")
    vision: Switch = Field("auto", description="whether the model sees pictures; auto: by its name")
    json_schema: Switch = Field(
        "auto", alias="schema", description="whether the service keeps answers to a JSON Schema; auto: by its name"
    )
    price_in: float | None = Field(None, ge=0.0, le=1e6, description="US dollars per million tokens of a prompt")
    price_out: float | None = Field(None, ge=0.0, le=1e6, description="US dollars per million tokens of an answer")

    @field_validator("api_key_env", "base_url_env")
    @classmethod
    def _is_set(cls, name: str) -> str:
        if name and not os.environ.get(name):
            shown = f"`{name}`" if re.fullmatch(r"[A-Z][A-Z0-9_]{0,63}", name) else "…"  # it may be the key itself
            raise ValueError(f"takes the name of an environment variable, and {shown} is not set: export it first")
        return name

    @field_validator("base_url_env")
    @classmethod
    def _names_address(cls, name: str) -> str:
        if name:
            _address(os.environ[name])
        return name

    @field_validator("base_url")
    @classmethod
    def _is_address(cls, url: str, info: ValidationInfo) -> str:
        named = info.data.get("base_url_env", url or "?")
        if url and named and "base_url_env" in info.data:
            raise ValueError("is given, and base_url_env too: leave one of them out")
        if not url:
            if not named and info.data.get("client") == "direct":
                raise ValueError(f"is missing: client=direct needs the service's address, {_FOR_INSTANCE}")
            return url
        if _address(url).login:
            raise ValueError(
                "holds a user or password, and options are written into the trace: export the address in a variable "
                "and give base_url_env=VARIABLE; a bearer key goes by api_key_env"
            )
        return url

    @property
    def capability(self) -> Capability:
        """What the model can do: by its name, unless an option says so."""
        known = capability_of(self.model)
        return replace(
            known,
            vision=known.vision if self.vision == "auto" else self.vision == "yes",
            json_schema=known.json_schema if self.json_schema == "auto" else self.json_schema == "yes",
        )

    @property
    def insists_on_temperature(self) -> bool:
        """Whether the temperature was given, so that it is sent to every model."""
        return "temperature" in self.model_fields_set

    @property
    def sent_temperature(self) -> float | None:
        """The temperature of every call; None for a model that takes none, unless it was given."""
        return self.temperature if self.insists_on_temperature or self.capability.temperature else None


def make_client(options: ReactOptions) -> ModelClient:
    """The client that the options ask for, behind a guard that knows its secrets."""
    key = os.environ.get(options.api_key_env, "")
    url = options.base_url or os.environ.get(options.base_url_env, "")
    service = _address(url) if url else Address("")
    if options.client == "litellm":
        load_litellm()  # seconds of import: before the first barrier, and a missing package is told at once
        secrets = (key, *service.secrets, *_keys_of_environment())
        return GuardedClient(LitellmClient(service.url, key, service.login), Redactor(secrets))
    return GuardedClient(DirectClient(service.url, key, service.login), Redactor((key, *service.secrets)))


def _address(url: str) -> Address:
    try:
        return address(url)
    except ValueError as error:
        raise ValueError(f"is not a service's address ({_FOR_INSTANCE}): {error}") from error


def _keys_of_environment() -> tuple[str, ...]:
    """The keys that litellm may find for itself."""
    return tuple(
        value
        for name, value in sorted(os.environ.items())
        if name.endswith(_KEY_VARIABLES) and len(value) >= _LEAST_KEY_LETTERS
    )
