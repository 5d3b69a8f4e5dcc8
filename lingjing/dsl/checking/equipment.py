"""Checkers of an asset's equipment: its cameras and its action space."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from lingjing.dsl.checking.blocks import BlockReader, DeclarationChecker
from lingjing.dsl.checking.keys import PropertyEntry, word_of
from lingjing.dsl.checking.scope import TypeDecl
from lingjing.dsl.checking.settings import SettingsChecker, split_guarded
from lingjing.dsl.checking.values import STATIC, UNKNOWN, TypedExpression
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.statements import KINDS, VIEWS
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.functions import Type
from lingjing.mission.units import BY_NAME


class EquipmentChecker(DeclarationChecker):
    """Checks the parts of an asset that are no properties."""

    def __init__(self, blocks: BlockReader, settings: SettingsChecker) -> None:
        super().__init__(blocks)
        self.settings = settings

    def equipment(
        self, node: s.EntityBlock, decl: TypeDecl | None
    ) -> tuple[tuple[model.Camera, ...], tuple[model.Verb, ...]]:
        """Cameras in the order of their declaration, and the verbs: those of `actions`, else all of the type's."""
        cameras: dict[str, model.Camera | None] = {}
        verbs: tuple[model.Verb, ...] | None = None
        for item in node.block.items if node.block else ():
            if isinstance(item, s.CameraBlock):
                if item.name.text in cameras:
                    self.report.at("LJ0104", item.name, f"`{item.name.text}` is declared twice")
                cameras[item.name.text] = self._camera(item)
            elif isinstance(item, s.SettingsBlock) and item.keyword == "actions":
                if verbs is not None:
                    self.report("LJ0103", item.start, item.start + len("actions"), "`actions` is given twice")
                verbs = self._actions(item, decl)
            elif isinstance(item, s.SettingsBlock):
                self.blocks.misplaced(item, f"`{node.name.text}`")
        if verbs is None:
            verbs = tuple(decl.verbs.values()) if decl else ()
        return tuple(camera for camera in cameras.values() if camera), verbs

    def _camera(self, node: s.CameraBlock) -> model.Camera | None:
        preset = self._preset(node)
        keys = KINDS["camera"].keys
        if preset or node.type is not None:
            keys = {name: msgspec.structs.replace(key, required=False) for name, key in keys.items()}
        plain, guarded = split_guarded(node.block)
        own = self.blocks.read(plain, keys, f"the camera `{node.name.text}`", owner=node.name)
        entries = {**preset, **own}
        view = word_of(entries, "view") or node.name.text
        if view not in VIEWS:
            self.report.at(
                "LJ0106",
                node.name,
                f"the camera `{node.name.text}` lacks `view`",
                f"add `view = …`: {', '.join(VIEWS)}",
            )
            return None
        missing = [key for key in ("size", "hfov", "channels") if key not in entries]
        if missing:
            if preset and not any(isinstance(item, s.Faulty | s.PropertyLine) for item in _items(node)):
                message = f"neither the camera `{node.name.text}` nor its preset has `{missing[0]}`"
                self.report.at("LJ0106", node.name, message, f"add `{missing[0]} = …`")
            return None
        width, height = entries["size"].parts
        return model.Camera(
            name=node.name.text,
            view=view,  # type: ignore[arg-type]
            width=width.ir,
            height=height.ir,
            hfov=entries["hfov"].value.ir,
            channels=_channels(entries["channels"]),
            alternatives=tuple(self._other_channels(node, guarded)),
            capture=word_of(entries, "capture") or "on_request",  # type: ignore[arg-type]
        )

    def _other_channels(self, node: s.CameraBlock, lines: tuple[s.PropertyLine, ...]) -> Iterator[model.OtherChannels]:
        """Yield the lines `channels = … when …`; no other line of a camera can have a condition."""
        keys = {"channels": KINDS["camera"].keys["channels"]}
        for line in lines:
            if line.name.text != "channels":
                self.report.at("LJ0307", line.guard or line, f"`{line.name.text}` cannot depend on a condition")
                continue
            for entries, guard in self.settings.guarded_lines((line,), keys, f"the camera `{node.name.text}`"):
                yield model.OtherChannels(channels=_channels(entries["channels"]), when=guard)

    def _preset(self, node: s.CameraBlock) -> dict[str, PropertyEntry]:
        if node.type is None:
            return {}
        decl = self.scope.cameras.get(node.type.text)
        if decl is None:
            self.of.unknown_name(node.type, list(self.scope.cameras), "no camera preset")
            return {}
        return decl.entries

    def _actions(self, node: s.SettingsBlock, decl: TypeDecl | None) -> tuple[model.Verb, ...]:
        verbs: dict[str, model.Verb] = {}
        for item in node.block.items:
            if isinstance(item, s.Faulty):
                continue
            if not isinstance(item, s.Bare | s.PropertyLine):
                self.blocks.misplaced(item, "`actions`")
                continue
            name = item.name
            verb = decl.verbs.get(name.text) if decl else None
            if name.text in verbs:
                self.report.at("LJ0103", name, f"`{name.text}` is given twice")
                continue
            if verb is None:
                if decl is not None:
                    self.report.unknown("LJ0113", name, f"the type `{decl.name}` has no verb `{name.text}`", decl.verbs)
                continue
            verbs[name.text] = verb if isinstance(item, s.Bare) else self._bounded(item, verb)
        return tuple(verbs.values())

    def _bounded(self, item: s.PropertyLine, verb: model.Verb) -> model.Verb:
        """Check bounds of a verb's first argument: `forward <= 50 m`, `forward in 5 m..25 m`, `forward = 10 m in …`."""
        first = verb.arguments[0] if verb.arguments else None
        if item.relation == "~" or item.hidden or item.state or item.guard:
            self.report(
                "LJ0303", item.start, item.value.start, "an action is named or bounded", f"write `{verb.name} <= …`"
            )
            return verb
        if first is None or first.dimension == "name":
            self.report.at("LJ0306", item.value, f"`{verb.name}` has no argument that could be bounded")
            return verb
        due = next(entry.dimension for entry in BY_NAME.values() if entry.unit == first.dimension)
        kind, what = Type("quantity", due), f"the bound of `{verb.name}`"
        default_node, bounds_node = _parts(item)
        default = None if default_node is None else self.of.expect(default_node, STATIC, kind, what)
        bounds = None
        if bounds_node is not None:
            wanted = kind if item.relation == "<=" else Type("range", due)
            bounds = self.of.expect(bounds_node, STATIC, wanted, what)
        for value, node in ((default, default_node), (bounds, bounds_node)):
            if value is not None and node is not None:
                self.blocks.leak(value.taint, node, f"the bound of the action `{verb.name}`")
        if default is UNKNOWN or bounds is UNKNOWN:
            return verb
        changed = _narrowed(first, default, bounds)
        if not self._inside(item, verb, first, changed):
            return verb
        return msgspec.structs.replace(verb, arguments=(changed, *verb.arguments[1:]))

    def _inside(self, item: s.PropertyLine, verb: model.Verb, first: model.Argument, changed: model.Argument) -> bool:
        least, most = (None if e is None else self.of.constant(e) for e in (first.minimum, first.maximum))
        low, high = (None if e is None else self.of.constant(e) for e in (changed.minimum, changed.maximum))
        default = None if changed.default is None else self.of.constant(changed.default)
        node = item.value
        for value in (low, high, default):
            if value is not None and ((least is not None and value < least) or (most is not None and value > most)):
                ends = ("" if least is None else f"{least:g}", "" if most is None else f"{most:g}")
                shown = f"{ends[0]}..{ends[1]} {first.dimension}"
                self.report.at("LJ0206", node, f"`{verb.name}` takes {shown}: the bound lies outside")
                return False
        if default is not None and ((low is not None and default < low) or (high is not None and default > high)):
            self.report.at("LJ0206", node, f"the default of `{verb.name}` is outside of its bounds")
            return False
        return True


def _channels(entry: PropertyEntry) -> tuple[str, ...]:
    listed = entry.value.ir
    names = listed.items if isinstance(listed, ex.Sequence) else ()
    return tuple(name.name for name in names if isinstance(name, ex.Symbol))


def _parts(item: s.PropertyLine) -> tuple[s.Expression | None, s.Expression | None]:
    """The default and the bounds in a line of `actions`."""
    value = item.value
    if item.relation != "=":
        return None, value
    if isinstance(value, s.BinaryExpr) and value.operator == "in":
        return value.left, value.right
    return value, None


def _narrowed(
    argument: model.Argument, default: TypedExpression | None, bounds: TypedExpression | None
) -> model.Argument:
    low, high = argument.minimum, argument.maximum
    if bounds is not None:
        low, high = (bounds.ir.low, bounds.ir.high) if isinstance(bounds.ir, ex.Range) else (low, bounds.ir)
    start = argument.default if default is None else default.ir
    optional = argument.optional or default is not None
    return msgspec.structs.replace(argument, minimum=low, maximum=high, default=start, optional=optional)


def _items(node: s.CameraBlock) -> tuple[s.Statement, ...]:
    return node.block.items if node.block else ()
