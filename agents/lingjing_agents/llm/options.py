"""The options of every policy over `llm`: the choice of a model and its parameters."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from os import environ
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationInfo, field_validator

from lingjing.plugins.backbone import Structured
from lingjing.plugins.options import Fault, Field, PluginOptions, options_error
from lingjing.plugins.policy import UsageError
from lingjing_agents.llm.address import Address, address
from lingjing_agents.llm.models import (
    UNKNOWN_PICTURES,
    ModelTraits,
    ServiceEntry,
    read_models,
    shipped_picture_rules,
)
from lingjing_agents.llm.picture_tokens import PictureRule

_FOR_INSTANCE = "for instance http://localhost:8000/v1"

Switch = Literal["auto", "yes", "no"]

DIRECT, LITELLM = "direct", "litellm"
OWN_BACKBONES = (DIRECT, LITELLM)
"""The backbones of this package."""


class ModelOptions(PluginOptions):
    """The model options of a policy. Options that are not set follow the table of models.

    Options are stored in the trace. A key, and an address with a password, are therefore given by the names of
    environment variables.
    """

    models: Path | None = Field(
        None, validate_default=True, description="a list of models over the shipped one (models.toml)"
    )
    model: str = Field(min_length=1, description="a model of the list, or any other model's name at its service")
    client: str = Field(
        DIRECT,
        description="the backbone: direct (an OpenAI-compatible server), litellm, or an installed one "
        "(`lingjing plugins`)",
    )
    api_key_env: str = Field("", description="environment variable that holds the service's key")
    base_url_env: str = Field("", description="environment variable that holds the service's address")
    base_url: str = Field("", validate_default=True, description=f"the service's address, {_FOR_INSTANCE}")
    temperature: float = Field(0.0, ge=0.0, le=2.0, description="left out for models that take none, unless given")
    reasoning_effort: str | None = Field(None, max_length=40, description="how long a reasoning model thinks")
    max_tokens: int = Field(2048, ge=16, le=1_000_000, description="the longest answer")
    tries: int = Field(5, ge=1, le=20, description="how often a call is tried that the service does not answer")
    vision: Switch = Field("auto", description="whether the model sees pictures; auto: by its name")
    structured: Literal["auto"] | Structured = Field("auto", description="how the service is asked for a step")
    json_schema: Switch = Field(
        "auto", alias="schema", description="whether the service keeps answers to a JSON Schema; auto: by its name"
    )
    price_in: float | None = Field(None, ge=0.0, le=1e6, description="US dollars per million tokens of a prompt")
    price_out: float | None = Field(None, ge=0.0, le=1e6, description="US dollars per million tokens of an answer")

    @field_validator("models")
    @classmethod
    def _is_a_list(cls, path: Path | None) -> Path | None:
        try:
            read_models(path)
        except UsageError as error:
            raise ValueError(f"cannot be used: {error}") from error
        return path

    @field_validator("client")
    @classmethod
    def _is_backbone(cls, name: str, info: ValidationInfo) -> str:
        if name not in OWN_BACKBONES:
            from lingjing.plugins.lookup import backbone_models  # its search for plug-ins costs time

            try:
                models = backbone_models(name)
            except UsageError as error:
                raise ValueError(f"is neither direct nor litellm, and {error}") from error
            model = info.data.get("model", "")
            if models is not None and model and model not in models:
                close = difflib.get_close_matches(model, models, n=1)
                hint = f"did you mean `{close[0]}`?" if close else f"its models: {', '.join(models) or 'none'}"
                raise ValueError(f"is `{name}`, which serves no model `{model}`") from UsageError("", hint=hint)
        return name

    def fingerprint(self) -> dict[str, str]:
        """Return the distribution of the backbone, unless it is one of this package."""
        if self.client in OWN_BACKBONES:
            return {}
        from lingjing.plugins.lookup import backbone_owner

        return {"backbone": f"{self.client} of {backbone_owner(self.client)}"}

    @field_validator("base_url")
    @classmethod
    def _is_address(cls, url: str, info: ValidationInfo) -> str:
        options = info.data
        if url and options.get("base_url_env"):
            raise ValueError("is given, and base_url_env too: leave one of them out")
        if url and _address(url).login:
            raise ValueError(
                "holds a user or password, and options are written into the trace: export the address in a variable "
                "and give base_url_env=VARIABLE; a bearer key goes by api_key_env"
            )
        if not url and not options.get("base_url_env") and _needs_address(options):
            problem = f"is missing: client=direct needs the service's address, {_FOR_INSTANCE}, or a model of the list"
            raise ValueError(problem) from UsageError("", hint=_nearest(options))
        return url

    @property
    def profile(self) -> ModelProfile:
        """The model with all its settings from the table and these options."""
        table = read_models(self.models)
        entry = table.entry(self.model)
        listed = table.services[entry.service] if entry else _unlisted(self.client)
        traits = table.traits(self.model)
        changes: dict[str, Any] = {"structured": self._structured(traits)}
        if self.vision != "auto":
            changes["images"] = self.vision == "yes"
        if self.reasoning_effort is not None:
            changes["reasoning_effort"] = self.reasoning_effort
        if self.price_in is not None or self.price_out is not None:
            changes |= {"price_in": self.price_in or 0.0, "price_out": self.price_out or 0.0, "price_cached": None}
        traits = traits.model_copy(update=changes)
        elsewhere = bool(self.base_url or self.base_url_env)
        return ModelProfile(
            served=entry.served if entry else self.model,
            service=_unlisted(self.client) if elsewhere else listed,
            client=self.client if elsewhere or "client" in self.model_fields_set else listed.client,
            traits=traits,
            pictures=table.picture_rule(traits),
            counted=_counted(table.picture_rule(traits)),
            temperature=self.temperature if self._is_given("temperature") or traits.takes_temperature else None,
            insist=self._is_given("temperature"),
            max_tokens=self.max_tokens,
            tries=self.tries,
        )

    def _structured(self, traits: ModelTraits) -> Structured:
        if self.structured != "auto":
            return self.structured
        if self.json_schema == "auto":
            return traits.structured
        return "none" if self.json_schema == "no" else "json_schema"

    def _is_given(self, name: str) -> bool:
        return name in self.model_fields_set

    def credentials(self, profile: ModelProfile) -> _Credentials:
        """Return the key and the address, read from the environment where variables are named.

        Raises `UsageError` with every variable that is not set or holds no address.
        """
        key_variable = self.api_key_env or profile.service.key_variable
        faults = list(_unset({"api_key_env" if self.api_key_env else "model": key_variable}))
        faults += _unset({"base_url_env": self.base_url_env})
        url = self.base_url or environ.get(self.base_url_env, "") or profile.service.base_url
        service = Address("")
        try:
            service = _address(url) if url else service
        except ValueError as error:  # its message quotes nothing of the URL
            faults.append(Fault("base_url_env", str(error)))
        if faults:
            raise options_error({"policy `react`": tuple(faults)})
        return _Credentials(service.url, environ.get(key_variable, ""), service.login, service.secrets)


@dataclass(frozen=True, slots=True)
class _Credentials:
    """The access data of a service."""

    url: str
    """The address without user and password."""
    key: str = field(default="", repr=False)
    """The key; "" without one."""
    login: str = field(default="", repr=False)
    """`user:password`; "" without one."""
    secrets: tuple[str, ...] = field(default=(), repr=False)
    """The parts of the login that must not be shown."""


@dataclass(frozen=True, slots=True)
class ModelProfile:
    """A model with all settings of a policy's calls."""

    served: str
    """The model's name at the service."""
    service: ServiceEntry
    """The service."""
    client: str
    """The client that makes the calls."""
    traits: ModelTraits
    """The abilities and prices of the model."""
    pictures: PictureRule
    """The rule that counts the tokens of the model's pictures."""
    counted: tuple[PictureRule, ...]
    """The rules that requests are budgeted with: all shipped ones, and the model's own."""
    temperature: float | None
    """The temperature to send; None for none."""
    insist: bool
    """True if the user set the temperature."""
    max_tokens: int
    """Bound on the tokens of an answer."""
    tries: int
    """Number of attempts per call."""


def _counted(own: PictureRule) -> tuple[PictureRule, ...]:
    """Return the rules that requests are budgeted with. A model of an unknown family changes nothing: it is sent the
    same turns as all others.
    """
    shipped = shipped_picture_rules()
    return shipped if own == UNKNOWN_PICTURES else tuple(dict.fromkeys((*shipped, own)))


def _unlisted(client: str) -> ServiceEntry:
    """Return a service outside the table. Nothing is known of it, and no key of another service is sent to it."""
    return ServiceEntry.model_validate({"client": client})


def _needs_address(options: Mapping[str, Any]) -> bool:
    """Return whether the model needs an address: it is called directly and has no service with one in the table."""
    if options.get("client") != DIRECT or not {"models", "base_url_env"} <= options.keys():
        return False
    table = read_models(options["models"])
    entry = table.entry(options.get("model", ""))
    return not entry or not table.services[entry.service].base_url


def _nearest(options: Mapping[str, Any]) -> str:
    """Return the hint for a name of no model of the list: the nearest one, or the command that lists them."""
    names = read_models(options["models"]).models
    close = difflib.get_close_matches(str(options.get("model", "")).lower(), names, n=1)
    return f"did you mean `{close[0]}`?" if close else "`lingjing plugins` lists them"


def _unset(named: Mapping[str, str]) -> Iterator[Fault]:
    """Yield a fault for each named variable that is not set.

    A text that does not look like a variable name may be the key itself, so it is not repeated.
    """
    for option, name in named.items():
        if name and not environ.get(name):
            shown = f"`{name}`" if re.fullmatch(r"[A-Z][A-Z0-9_]{0,63}", name) else "…"
            problem = f"takes the name of an environment variable, and {shown} is not set: export it first"
            if option == "model":
                problem = f"is at a service whose key is in {shown}, which is not set: export it first"
            yield Fault(option, problem)


def _address(url: str) -> Address:
    try:
        return address(url)
    except ValueError as error:
        raise ValueError(f"is not a service's address ({_FOR_INSTANCE}): {error}") from error
