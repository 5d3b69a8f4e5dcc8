"""Checkers of bodies in types: measures, colour, shape and look as properties; `mount` and `part` as blocks.

Mounts and parts are constant: a body is the same in every mission. A mission may give its entities other measures and
colours, like any other property.
"""

from __future__ import annotations

from typing import Literal, cast

from lingjing.dsl.checking.blocks import DeclarationChecker
from lingjing.dsl.checking.keys import PropertyEntry, word_of
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.keys import PropertyKey, keyed
from lingjing.dsl.syntax.statements import DRAWN, KINDS, VIEWS
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.appearance import (
    BARE,
    COLOURS,
    GLB,
    LEAST_M,
    MEASURES,
    MODELS,
    MOST_M,
    ORIGINS,
    RESHAPING,
    SHAPES,
    VARIANT,
    VARIANT_MOST,
)
from lingjing.mission.functions import METRES, NUMBER, Type
from lingjing.mission.units import MASS
from lingjing.mission.vocabulary import PORTRAIT

_MOST_KG = 1e7
"""Greatest mass, kilograms (chosen)."""

_FIELDS = {"heading": "heading_deg", "glow": "glow"}
"""The fields of a part's numbers that are no metres."""

BODY_KEYS = keyed(
    *(PropertyKey(name, METRES, DRAWN, low=LEAST_M, high=MOST_M, hideable=True, public=False) for name in MEASURES),
    PropertyKey("mass", Type("quantity", MASS), DRAWN, above=0, high=_MOST_KG, hideable=True, public=False),
    PropertyKey("colour", Type("name"), DRAWN, choices=tuple(COLOURS), hideable=True, public=False),
    PropertyKey("shape", Type("name"), choices=(*SHAPES, BARE)),
    PropertyKey("origin", Type("name"), choices=ORIGINS),
    PropertyKey("look", Type("name"), choices=(*MODELS, BARE), file_ending=GLB),
    PropertyKey(PORTRAIT, METRES, low=4, high=200, public=False),
    PropertyKey(VARIANT, NUMBER, DRAWN, low=0, high=VARIANT_MOST, whole=True, hideable=True, public=False),
)
"""Properties of any type and entity: size, mass and colour of the body, its collision shape, the position's place in
it, the camera's model for it, the distance of its reference picture and the variant of that model."""


def reshaped(changed: set[str]) -> bool:
    """True if the changed properties give the body another shape than that of the type that it extends."""
    return "look" not in changed and not RESHAPING.isdisjoint(changed)


class BodyChecker(DeclarationChecker):
    """The mounts and parts of asset and target types."""

    def mounts(self, nodes: list[s.MountBlock], base: dict[str, model.CameraMount]) -> dict[str, model.CameraMount]:
        """View → mount of its cameras: the type's own, and those of its base for other views."""
        made = dict(base)
        seen: set[str] = set()
        for node in nodes:
            name = node.view
            entries = self.blocks.read(node.block, KINDS["mount"].keys, f"the mount `{name.text}`", owner=name)
            if self._known(name, VIEWS, "view") and self._once(name, seen):
                numbers = self._constants(entries)
                gimbal = entries.get("gimbal")
                if {"ahead", "above", "tilt"} <= numbers.keys():
                    made[name.text] = model.CameraMount(
                        view=cast("Literal['nadir', 'front', 'oblique']", name.text),
                        ahead_m=numbers["ahead"],
                        above_m=numbers["above"],
                        tilt_deg=numbers["tilt"],
                        gimbal=gimbal is None or gimbal.value.ir != ex.Flag(value=False),
                    )
        return made

    def parts(self, nodes: list[s.PartBlock], base: dict[str, model.BodyPart]) -> dict[str, model.BodyPart]:
        """Name → solid part: the type's own, and the other parts of its base."""
        made = dict(base)
        seen: set[str] = set()
        for node in nodes:
            name = node.name
            entries = self.blocks.read(node.block, KINDS["part"].keys, f"the part `{name.text}`", owner=name)
            if self._known(node.shape, SHAPES, "shape") and self._once(name, seen):
                numbers = self._constants(entries)
                if numbers.keys() >= set(MEASURES):
                    units = {key: _FIELDS.get(key, f"{key}_m") for key in numbers}
                    made[name.text] = model.BodyPart(
                        name=name.text,
                        shape=cast("Literal['box', 'cylinder', 'sphere', 'cone']", node.shape.text),
                        colour=word_of(entries, "colour") or "grey",
                        **{units[key]: value for key, value in numbers.items()},
                    )
        return made

    def _known(self, name: s.Name, known: tuple[str, ...], what: str) -> bool:
        if name.text in known:
            return True
        self.report.unknown("LJ0109", name, f"no {what} is called `{name.text}`", known)
        return False

    def _once(self, name: s.Name, seen: set[str]) -> bool:
        if name.text in seen:
            self.report.at("LJ0104", name, f"`{name.text}` is declared twice")
            return False
        seen.add(name.text)
        return True

    def _constants(self, entries: dict[str, PropertyEntry]) -> dict[str, float]:
        """The numbers among the entries. Reports entries that are not constant."""
        numbers = {}
        for name, entry in entries.items():
            if entry.key.type.kind != "quantity":
                continue
            number = self.blocks.of.constant(entry.value.ir)
            if number is None:
                place = entry.node.value
                self.report.at("LJ0201", place, f"`{name}` of a body is a constant")
            else:
                numbers[name] = number
        return numbers
