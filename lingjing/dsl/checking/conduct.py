"""Checkers of restrictions while a mission runs: counted budgets, permits, constraints, inspections of routes.

The kernel enforces them, and they are a part of its state (ADR 0009).
"""

from __future__ import annotations

from typing import Literal

from lingjing.dsl.checking.blocks import BlockReader, DeclarationChecker
from lingjing.dsl.checking.keys import PropertyEntry, word_of
from lingjing.dsl.checking.leaks import declassified_name
from lingjing.dsl.checking.rules import RuleChecker
from lingjing.dsl.checking.scope import PARAMS
from lingjing.dsl.checking.settings import SettingsChecker
from lingjing.dsl.checking.values import RULE, STATIC, UNKNOWN, TypedExpression
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.statements import CONSTRAINT_KINDS, KINDS
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.functions import FLAG, NUMBER

CLAIMS = "claims"
"""The word in `counts claims`: the positive claims of all agents."""


class ConductChecker(DeclarationChecker):
    """Checks constraints of conduct. A method for each kind returns its part of the graph, or None if it is faulty."""

    def __init__(self, blocks: BlockReader, settings: SettingsChecker, rules: RuleChecker) -> None:
        super().__init__(blocks)
        self.settings = settings
        self.rules = rules

    def head(self, node: s.InspectionBlock | s.LimitLine) -> None:
        """Register the name of an inspection or a counted budget, for the functions that read it."""
        table = self.scope.inspections if isinstance(node, s.InspectionBlock) else self.scope.limits
        what = "inspection" if isinstance(node, s.InspectionBlock) else "limit"
        self.report.once(table, node.name, f"the {what}")

    def stage_limit(self, node: s.LimitLine) -> model.Limit | None:
        """A limit inside a stage."""
        return self.limit(node, in_stage=True)

    def limit(self, node: s.LimitLine, *, in_stage: bool = False) -> model.Limit | None:
        """Check the statement `limit moves <= 50 counts dog.forward, guide`."""
        most = self.of.expect(node.most, STATIC, NUMBER, f"the limit `{node.name.text}`")
        self.blocks.leak(most.taint, node.most, f"the limit `{node.name.text}`")
        constant = self.of.constant(most.ir)
        if constant is not None and (constant < 0 or constant != int(constant)):
            self.report.at("LJ0206", node.most, "a limit counts in whole numbers from 0")
        counted = [self._counted(channel) for channel in node.counts]
        guard = self.settings.guard(node.guard)
        if most is UNKNOWN or None in counted:
            return None
        kept = tuple(item for item in counted if item is not None)
        claims = [channel for channel, item in zip(node.counts, kept, strict=True) if item.kind == "claims"]
        if claims and (len(kept) > 1 or in_stage):
            hint = "write it in the mission: `limit positives <= 10 counts claims`"
            self.report.at("LJ0110", claims[0], "claims have a limit of their own for the whole episode", hint)
            return None
        if claims and constant == 0.0:
            message = "a limit of 0 claims admits none, so that no report can count"
            self.report.at("LJ0206", node.most, message, "permit at least one claim, or leave the limit out")
            return None
        return model.Limit(name=node.name.text, most=most.ir, counts=kept, when=guard)

    def permit(self, node: s.PermitLine) -> model.Permit | None:
        """Check the statement `permit van.setDestination when …`."""
        channel = node.resource
        resource, verb = self._command(channel, "`permit`")
        condition = self.of.expect(node.condition, RULE, FLAG, "`when`")
        if resource is None or condition is UNKNOWN:
            return None
        return model.Permit(resource=resource.ir, verb=verb, condition=condition.ir)

    def declassified(self, node: s.DeclassifyLine) -> tuple[model.Declassification, ...]:
        """Check the statement `declassify end, dog.forward because "…"`."""
        reason = node.reason.value.strip()
        if not reason:
            self.report.at("LJ0106", node.reason, "a declassification needs a reason", "say why agents may know it")
        return tuple(model.Declassification(what=declassified_name(item), reason=reason) for item in node.what)

    def constraint(self, node: s.ConstraintBlock) -> model.Constraint | None:
        """Check the statement `constraint hard name per v in group { always … }`."""
        if node.kind.text not in CONSTRAINT_KINDS:
            message = f"a constraint is hard or soft, not `{node.kind.text}`"
            self.report.unknown("LJ0109", node.kind, message, CONSTRAINT_KINDS)
            return None
        self._named(node.name)
        environment = self.rules.per(node.variable, node.domain)
        what = f"the constraint `{node.name.text}`"
        keys = KINDS["constraint"].keys
        entries = self.blocks.read(node.block, keys, what, others=(s.Condition,), owner=node.name)
        condition = self.rules.only_condition(node.block, "always", what, node.name, others=(s.PropertyLine,))
        guard = self.settings.guard(node.guard)
        penalty = entries.get("penalty")
        if penalty is not None and node.kind.text == "hard":
            place = penalty.node
            self.report.at("LJ0110", place, "a hard constraint has no penalty: it decides the episode")
        faulty = any(isinstance(i, s.Faulty) or _is_penalty(i) for i in node.block.items)
        if penalty is None and node.kind.text == "soft" and not faulty:
            message, hint = f"{what} has no penalty, so that breaking it costs nothing", "add `penalty = 10 %`"
            self.report.at("LJ0512", node.name, message, hint, severity="warning")
        if condition is None or environment is None:
            return None
        value = self.of.expect(condition, environment, FLAG, "`always`")
        kind: Literal["hard", "soft"] = "hard" if node.kind.text == "hard" else "soft"
        return model.Constraint(
            name=node.name.text,
            kind=kind,
            condition=value.ir,
            variable=node.variable.text if node.variable else None,
            domain=node.domain.text if node.domain else None,
            penalty=penalty.value.ir if penalty else None,
            when=guard,
        )

    def inspection(self, node: s.InspectionBlock) -> model.Inspection | None:
        """Check the statement `inspection name of asset by inspectors { within = …, replan = … }`."""
        what = f"the inspection `{node.name.text}`"
        entries = self.blocks.read(node.block, KINDS["inspection"].keys, what, owner=node.name)
        asset = self.asset(node.asset, "after `of`")
        if asset is not None and asset.type.kind == "group":
            self.report.at("LJ0201", node.asset, "one asset's route is inspected, this is a group")
            asset = None
        by = [self.asset(part, "after `by`") for part in node.by]
        replan = entries.get("replan")
        if replan is not None and isinstance(replan.node.value, s.Name):
            name = replan.node.value
            if name.text not in self.scope.messages:
                self.of.unknown_name(name, list(self.scope.messages), "no message kind")
        guard = self.settings.guard(node.guard)
        if asset is None or None in by or "within" not in entries:
            return None
        destination = self._destination(entries.get("destination"))
        return model.Inspection(
            name=node.name.text,
            asset=asset.ir,
            by=tuple(item.ir for item in by if item is not None),
            within=entries["within"].value.ir,
            order="any" if word_of(entries, "order") == "any" else "strict",
            replan=word_of(entries, "replan"),
            destination=destination,
            pictured=entries["pictured"].value.ir if "pictured" in entries else None,
            when=guard,
        )

    # -- private

    def _named(self, name: s.Name) -> None:
        """Register a constraint's name. A broken constraint is an event of that name, like a rule that has become
        true."""
        rule = self.scope.rules.get(name.text)
        if rule is not None:
            self.report.declared_twice(name, f"`{name.text}`", rule.span)
        self.report.once(self.scope.constraints, name, "the constraint")

    def _destination(self, entry: PropertyEntry | None) -> ex.Expr | None:
        """The end of the inspected route: an entity with a public place, since every agent may see its route."""
        if entry is None:
            return None
        place = self.scope.groups[entry.value.type.of].attributes.get("position")
        if place is not None:
            self.blocks.leak(place.taint, entry.node.value, "the route")
        return entry.value.ir

    def _counted(self, channel: s.ObservedChannel) -> model.Counted | None:
        node = channel.source
        if isinstance(node, s.Name) and node.text in self.scope.messages and not channel.everything:
            return model.Counted(kind="message", name=node.text)
        named = self.scope.symbols.get(node.text) if isinstance(node, s.Name) else None
        if isinstance(node, s.Name) and node.text == CLAIMS and (named is None or named.kind in PARAMS):
            return model.Counted(kind="claims")
        resource, verb = self._command(channel, "`counts`")
        return None if resource is None else model.Counted(kind="command", resource=resource.ir, name=verb)

    def _command(self, channel: s.ObservedChannel, what: str) -> tuple[TypedExpression | None, str]:
        """Check `dog.forward`, `dog.*` or `dog`. Return the resource and the verb, "" for all verbs."""
        node = channel.source
        if channel.everything or not isinstance(node, s.FieldExpr):
            return self.asset(node, f"after {what}"), ""
        resource = self.asset(node.base, f"after {what}")
        if resource is None:
            return None, ""
        decl = self.scope.groups[resource.type.of].type
        if decl is not None and node.name.text not in decl.verbs:
            self.report.unknown(
                "LJ0113", node.name, f"the type `{decl.name}` has no verb `{node.name.text}`", decl.verbs
            )
            return None, ""
        return resource, node.name.text


def _is_penalty(item: s.Statement) -> bool:
    """True for a line `penalty = …`, also one with an error."""
    return isinstance(item, s.PropertyLine) and item.name.text == "penalty"
