"""What is known of chat models and their services: `models.toml`, and a file of the user's own that adds to it.

`read_models` gives the table; `ModelTable.entry` finds a model by name and `ModelTable.traits` what a name that is not
in the table says by itself. The services' own lists are not asked: they are wrong for local models.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import Any, Literal

from pydantic import field_validator, model_validator

from lingjing.plugins.chat_model import ModelPlugin, Tier
from lingjing.plugins.options import Fault, Field, PluginOptions, option_faults
from lingjing.plugins.policy import UsageError
from lingjing_agents.llm.address import address
from lingjing_agents.llm.chat import Structured, TokenLimit

SHIPPED = Path(__file__).with_name("models.toml")
OWN_VARIABLE = "LINGJING_MODELS"
IMAGE_TOKENS = 4096
"""The most tokens that a picture of 1920 by 1080 pixels is taken to cost where a model does not say (Qwen3-VL: one
token for 32 by 32 pixels makes 2,040)."""

MOST_BYTES = 4 * 1024 * 1024

_PRICE = Field(None, ge=0.0, le=1e6)
_CONTEXT = Field(None, ge=1, le=2**40)


class _Checked(PluginOptions, strict=True):
    """A part of the file: unknown names are faults, and a text is no number."""


class ModelTraits(_Checked):
    """What a model can do, how it is asked and what it costs; the head of `models.toml` explains each."""

    images: bool = True
    most_images: int | None = Field(None, ge=1, le=1000)
    image_side: int | None = Field(None, ge=64, le=16384)
    image_tokens: int = Field(IMAGE_TOKENS, ge=1, le=10**6)
    structured: Structured = "json_schema"
    limit: TokenLimit = "max_tokens"
    temperature: Literal["yes", "no", "without reasoning"] = "yes"
    reasoning_effort: str = Field("", max_length=40)
    extra_body: dict[str, Any] = {}
    context: int | None = _CONTEXT
    price_in: float | None = _PRICE
    price_cached: float | None = _PRICE
    price_out: float | None = _PRICE
    price_source: str = ""

    @model_validator(mode="after")
    def _prices_go_together(self) -> ModelTraits:
        if (self.price_in is None) != (self.price_out is None):
            raise ValueError("price_in and price_out go together: give both, or neither")
        return self

    @property
    def takes_temperature(self) -> bool:
        """Whether a temperature is sent."""
        plain = self.temperature == "without reasoning" and self.reasoning_effort == "none"
        return self.temperature == "yes" or plain

    @property
    def priced(self) -> bool:
        """Whether its price is known; 0 is a price."""
        return self.price_in is not None and self.price_out is not None

    def cost_usd(self, prompt: int, answer: int, cached: int = 0) -> float | None:
        """US dollars of so many tokens, of the prompt's `cached` ones at their own price; None if it is not known."""
        if self.price_in is None or self.price_out is None:
            return None
        price_cached = self.price_in if self.price_cached is None else self.price_cached
        fresh = max(0, prompt - cached)
        return (fresh * self.price_in + min(cached, prompt) * price_cached + answer * self.price_out) / 1e6


NOTHING_SPECIAL = ModelTraits.model_validate({})
"""What is taken of a model of which nothing is known: a service that does not take what it is sent says so."""


class ModelEntry(ModelTraits):
    """A model that a name stands for."""

    service: str
    served: str = Field(min_length=1, max_length=200)
    title: str = Field("", max_length=100)
    tier: Tier = "open"


class FamilyEntry(ModelTraits):
    """What the names that fit a pattern say by themselves."""

    pattern: str = Field(min_length=1, max_length=100)


class ServiceEntry(_Checked):
    """Where models are served, and what all processes of a machine together may ask of it."""

    base_url: str = ""
    key_variable: str = Field("", pattern=r"^([A-Z][A-Z0-9_]{0,63})?$")
    client: Literal["direct", "litellm"] = "direct"
    concurrency: int | None = Field(None, ge=1, le=10_000)
    requests_per_minute: float | None = Field(None, gt=0.0, le=1e6)
    tokens_per_minute: float | None = Field(None, gt=0.0, le=1e12)

    @field_validator("base_url")
    @classmethod
    def _is_address(cls, url: str) -> str:
        if url and address(url).login:
            raise ValueError("holds a user or password, which belong into an environment variable (base_url_env=)")
        return url


class ModelTable(_Checked):
    """A file of models, or several in one. An entry of a model names a service of the table."""

    services: dict[str, ServiceEntry] = {}
    models: dict[str, ModelEntry] = {}
    families: list[FamilyEntry] = []

    def entry(self, name: str) -> ModelEntry | None:
        """The model of that name, if the table has it."""
        return self.models.get(name)

    def traits(self, name: str) -> ModelTraits:
        """What is known of a model: its entry, else the first family that its name fits, else nothing special."""
        if name in self.models:
            return self.models[name]
        short = name.rsplit("/", 1)[-1].lower()
        return next((family for family in self.families if fnmatchcase(short, family.pattern)), NOTHING_SPECIAL)


def read_models(own: Path | None = None) -> ModelTable:
    """The shipped table with a user's own over it: `own`, else the file that `LINGJING_MODELS` names, else
    `lingjing/models.toml` in the user's configuration folder if it is there.

    Raises `UsageError` that tells every fault of a file with its path.
    """
    named = own or (Path(os.environ[OWN_VARIABLE]) if os.environ.get(OWN_VARIABLE) else None)
    path = named or _configuration() / "lingjing" / "models.toml"
    shipped = _shipped()
    return _merged(shipped, _read(path, shipped)) if named or path.is_file() else shipped


def known_models() -> tuple[ModelPlugin, ...]:
    """The models of the table as a plug-in declares them, for suites and lists."""
    table = read_models()
    return tuple(
        ModelPlugin(
            name=name,
            policy="react",
            arguments={"model": name},
            tier=entry.tier,
            price_in=entry.price_in,
            price_out=entry.price_out,
            image_tokens=entry.image_tokens,
            summary=_summary(entry, table.services[entry.service]),
            title=entry.title or name,
            key_variable=table.services[entry.service].key_variable,
        )
        for name, entry in table.models.items()
    )


def _summary(entry: ModelEntry, service: ServiceEntry) -> str:
    key = f"key in {service.key_variable}" if service.key_variable else "no key"
    context = f"{entry.context:,} tokens" if entry.context else "context not known"
    takes = "pictures" if entry.images else "text alone"
    price = f"; price: {entry.price_source}" if entry.price_source else ""
    return f"{entry.title or entry.served}: {entry.served} at {entry.service}, {key}; {context}, {takes}{price}"


def _configuration() -> Path:
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")


@cache
def _shipped() -> ModelTable:
    return _read(SHIPPED, ModelTable())


def _merged(table: ModelTable, own: ModelTable) -> ModelTable:
    return ModelTable(
        services={**table.services, **own.services},
        models={**table.models, **own.models},
        families=[*own.families, *table.families],
    )


def _read(path: Path, below: ModelTable) -> ModelTable:
    """The file's own table; its models may also name services of the table below it."""
    given = _toml(path)
    faults = (*option_faults(ModelTable, given), *_unknown_services(given, below))
    if faults:
        lines = "\n".join(f"{path}: {one.where}: {one.message}" for one in faults)
        hint = f"{SHIPPED.name} of the agents' package is an example; its head explains each entry"
        raise UsageError(lines, hint=hint, faults=faults)
    return ModelTable.model_validate(given)


def _toml(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            raise UsageError(f"{path} is longer than {MOST_BYTES} bytes, so it is no list of models")
        return tomllib.loads(data.decode())
    except OSError as error:
        raise UsageError(f"cannot read the models in `{path}`: {error.strerror}") from error
    except (ValueError, RecursionError) as error:  # beside `TOMLDecodeError`: no UTF-8, or a number of 4,301 digits
        raise UsageError(f"{path} is not TOML: {error}") from error


def _unknown_services(given: Mapping[str, Any], below: ModelTable) -> list[Fault]:
    models, services = given.get("models"), given.get("services")
    known = dict.fromkeys((*below.services, *(services if isinstance(services, dict) else ())))
    named = {
        name: entry["service"]
        for name, entry in (models.items() if isinstance(models, dict) else ())
        if isinstance(entry, dict) and isinstance(entry.get("service"), str)
    }
    return [
        Fault(f"models.{name}.service", f"no service is called `{service}`; there are: {', '.join(known)}")
        for name, service in named.items()
        if service not in known
    ]
