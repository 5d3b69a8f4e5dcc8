"""The known chat models and services: `models.toml`, and a user's own file that adds to it.

`read_models` returns the table. `ModelTable.entry` finds a model by name; `ModelTable.traits` derives the traits of a
name that is not in the table. The services' own lists are not used, because they are wrong for local models.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import Any, Literal

from pydantic import field_validator, model_validator

from lingjing.plugins.backbone import Structured, TokenLimit
from lingjing.plugins.chat_model import ModelPlugin, Tier
from lingjing.plugins.options import Fault, Field, PluginOptions, option_faults
from lingjing.plugins.policy import UsageError
from lingjing_agents.llm.address import address
from lingjing_agents.llm.picture_tokens import FULL_PICTURE, PictureRule

SHIPPED = Path(__file__).with_name("models.toml")
"""The table that ships with this package."""
OWN_VARIABLE = "LINGJING_MODELS"
"""The environment variable with the path of a user's own table."""
UNKNOWN_PICTURES = PictureRule.model_validate({"rule": "fixed", "tokens": 4096})
"""The tokens of a picture for models without a declared rule. Chosen: more than any shipped rule counts for 1920 by
1080 pixels.
"""

MOST_BYTES = 4 * 1024 * 1024
"""Largest file that is read as a table. Chosen."""

_PRICE = Field(None, ge=0.0, le=1e6)
_CONTEXT = Field(None, ge=1, le=2**40)


class _Checked(PluginOptions, strict=True):
    """A part of the file. Unknown names are faults, and a text is no number."""


class ModelTraits(_Checked):
    """The abilities, parameters and prices of a model; the head of `models.toml` explains each field."""

    images: bool = True
    most_images: int | None = Field(None, ge=1, le=1000)
    image_side: int | None = Field(None, ge=64, le=16384)
    image_tokens: int | None = Field(None, ge=1, le=10**6)
    pictures: str = ""
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
        """True if a temperature is sent."""
        plain = self.temperature == "without reasoning" and self.reasoning_effort == "none"
        return self.temperature == "yes" or plain

    @property
    def priced(self) -> bool:
        """True if the price is known; 0 is a price."""
        return self.price_in is not None and self.price_out is not None

    def cost_usd(self, prompt: int, answer: int, cached: int = 0) -> float | None:
        """Return the cost in US dollars, with `cached` tokens of the prompt at their own price; None if the price is
        unknown.
        """
        if self.price_in is None or self.price_out is None:
            return None
        price_cached = self.price_in if self.price_cached is None else self.price_cached
        fresh = max(0, prompt - cached)
        return (fresh * self.price_in + min(cached, prompt) * price_cached + answer * self.price_out) / 1e6


NOTHING_SPECIAL = ModelTraits.model_validate({})
"""The traits of unknown models. A service rejects parameters that it does not support, and `direct.Dialect` adapts."""


class ModelEntry(ModelTraits):
    """A model with its name at a service."""

    service: str
    served: str = Field(min_length=1, max_length=200)
    title: str = Field("", max_length=100)
    tier: Tier = "open"


class FamilyEntry(ModelTraits):
    """The traits of all names that match a pattern."""

    pattern: str = Field(min_length=1, max_length=100)


class ServiceEntry(_Checked):
    """A service, with limits for all processes of a machine together."""

    base_url: str = ""
    key_variable: str = Field("", pattern=r"^([A-Z][A-Z0-9_]{0,63})?$")
    client: str = "direct"
    concurrency: int | None = Field(None, ge=1, le=10_000)
    requests_per_minute: float | None = Field(None, gt=0.0, le=1e6)
    tokens_per_minute: float | None = Field(None, gt=0.0, le=1e12)
    cache_from: int | None = Field(None, ge=1, le=10**6)
    cache_step: int = Field(1, ge=1, le=10**6)

    @field_validator("base_url")
    @classmethod
    def _is_address(cls, url: str) -> str:
        if url and address(url).login:
            raise ValueError("holds a user or password, which belong into an environment variable (base_url_env=)")
        return url


class ModelTable(_Checked):
    """One or several files of models. Each model names a service of the table."""

    services: dict[str, ServiceEntry] = {}
    pictures: dict[str, PictureRule] = {}
    models: dict[str, ModelEntry] = {}
    families: list[FamilyEntry] = []

    def entry(self, name: str) -> ModelEntry | None:
        """Return the model of that name, or None."""
        return self.models.get(name)

    def picture_rule(self, traits: ModelTraits) -> PictureRule:
        """Return the rule that counts the tokens of a model's pictures."""
        if traits.image_tokens is not None:
            return PictureRule.model_validate({"rule": "fixed", "tokens": traits.image_tokens})
        return self.pictures.get(traits.pictures, UNKNOWN_PICTURES)

    def traits(self, name: str) -> ModelTraits:
        """Return the traits of a model: those of its entry, else of the first matching family, else
        `NOTHING_SPECIAL`.
        """
        if name in self.models:
            return self.models[name]
        short = name.rsplit("/", 1)[-1].lower()
        return next((family for family in self.families if fnmatchcase(short, family.pattern)), NOTHING_SPECIAL)


def read_models(own: Path | None = None) -> ModelTable:
    """Return the shipped table, extended by a user's own table.

    The own table is `own`, else the file in `LINGJING_MODELS`, else `lingjing/models.toml` in the user's configuration
    folder if it exists. Raises `UsageError` with every fault of a file.
    """
    named = own or (Path(os.environ[OWN_VARIABLE]) if os.environ.get(OWN_VARIABLE) else None)
    path = named or _configuration() / "lingjing" / "models.toml"
    shipped = _shipped()
    return _merged(shipped, _read(path, shipped)) if named or path.is_file() else shipped


def known_models() -> tuple[ModelPlugin, ...]:
    """Return the models of the table as plug-in declarations, for suites and lists."""
    table = read_models()
    return tuple(
        ModelPlugin(
            name=name,
            policy="react",
            arguments={"model": name},
            tier=entry.tier,
            price_in=entry.price_in,
            price_out=entry.price_out,
            image_tokens=table.picture_rule(entry).count(FULL_PICTURE),
            summary=_summary(entry, table.services[entry.service]),
            title=entry.title or name,
            key_variable=table.services[entry.service].key_variable,
        )
        for name, entry in table.models.items()
    )


def shipped_picture_rules() -> tuple[PictureRule, ...]:
    """Return the rules of the shipped table."""
    return tuple(_shipped().pictures.values())


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
        pictures={**table.pictures, **own.pictures},
        models={**table.models, **own.models},
        families=[*own.families, *table.families],
    )


def _read(path: Path, below: ModelTable) -> ModelTable:
    """Return the table of a file. Its models may also name services of the table `below`."""
    content = _toml(path)
    faults = (*option_faults(ModelTable, content), *_unknown_names(content, below))
    if faults:
        lines = "\n".join(f"{path}: {fault.where}: {fault.message}" for fault in faults)
        hint = f"{SHIPPED.name} of the agents' package is an example; its head explains each entry"
        raise UsageError(lines, hint=hint, faults=faults)
    return ModelTable.model_validate(content)


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


def _unknown_names(content: Mapping[str, Any], below: ModelTable) -> Iterator[Fault]:
    """Yield a fault for each service and each rule for pictures that an entry names and no table has."""
    models, families = content.get("models"), content.get("families")
    entries = {f"models.{name}": entry for name, entry in models.items()} if isinstance(models, dict) else {}
    if isinstance(families, list):
        entries |= {f"families.{number}": entry for number, entry in enumerate(families)}
    known = {"service": dict.fromkeys(below.services), "pictures": dict.fromkeys(("", *below.pictures))}
    for field, section in (("service", "services"), ("pictures", "pictures")):
        own = content.get(section)
        known[field] |= dict.fromkeys(own if isinstance(own, dict) else ())
    kinds = {"service": "service", "pictures": "rule for pictures"}
    for where, entry in entries.items():
        for field, kind in kinds.items():
            name = entry.get(field) if isinstance(entry, dict) else None
            if isinstance(name, str) and name not in known[field]:
                there = ", ".join(filter(None, known[field])) or "none"
                yield Fault(f"{where}.{field}", f"no {kind} is called `{name}`; there are: {there}")
