"""Tiers: the paper's mission, and hardened forms of it.

Concepts. *Tier 0* is the mission with the defaults of its params. For the missions of the paper it is the paper's
mission. *Tier 1* hardens it: claims are limited, success asks for evidence, and worlds vary with the seed. Tiers 2 and
3 are reserved for noise of sensors, loss of messages, late targets and partners that fail. A mission declares a tier as
values of its params (`tier 1 { claims }`), so that each switch can also be set alone, and a study can measure each by
itself. Results of different tiers are never compared (ADR 0049).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

import msgspec

from lingjing.errors import Fault, UsageError
from lingjing.mission import model
from lingjing.mission.evaluate import Scope, evaluate
from lingjing.mission.expression import Expr
from lingjing.mission.values import as_number

HIGHEST = 3
"""The highest tier that a mission may declare; 2 and 3 are reserved (the module's docstring)."""
USUAL = 1
"""The tier that suites play where a mission declares it."""
PLAYED = 1
"""The highest tier that can be declared and played today."""


RESERVED = "noise of sensors, loss of messages, late targets and partners that fail"
"""The contents of the tiers above `PLAYED`, which are reserved."""
RESERVED_SWITCHES = ("noise",)
"""Names of switches that are reserved with these tiers."""


def tiers_of(mission: model.Mission) -> tuple[int, ...]:
    """The tiers in which the mission can be played: 0, then those that it declares."""
    return (0, *sorted(tier.level for tier in mission.tiers))


def settings_of_tier(mission: model.Mission, tier: int, mode: str) -> dict[str, float]:
    """The values of params that the tier sets, SI units; 1 and 0 for a switch.

    Raises `UsageError` with a fault at `tier` if the mission does not declare the tier.
    """
    if tier == 0:
        return {}
    declared = next((each for each in mission.tiers if each.level == tier), None)
    if declared is None:
        raise _undeclared(mission, tier)
    return {setting.name: setting_value(setting, Scope(mode=mode)) for setting in declared.settings}


def without_settings(tiers: Iterable[model.Tier], names: Collection[str]) -> tuple[model.Tier, ...]:
    """The tiers without their values for some params: those that count members with written places."""
    return tuple(
        msgspec.structs.replace(tier, settings=tuple(each for each in tier.settings if each.name not in names))
        for tier in tiers
    )


def setting_value(setting: model.Setting, scope: Scope) -> float:
    """The SI value of a declared setting; 1 or 0 for a switch."""
    return setting_number(setting.value, scope)


def setting_number(expr: Expr, scope: Scope) -> float:
    """The value of a param as settings hold it: in SI units, 1 or 0 for a switch."""
    value = evaluate(expr, scope)
    return float(value) if isinstance(value, bool) else as_number(value)


def with_tier(mission: model.Mission, tier: int, mode: str, settings: Mapping[str, float]) -> dict[str, float]:
    """The settings of the tier, and over them the settings of a run. Raises `UsageError` like `settings_of_tier`."""
    return {**settings_of_tier(mission, tier, mode), **settings}


def reserved_switch_error(name: str) -> UsageError:
    """The error for a setting of a reserved switch that the mission does not declare."""
    return UsageError(
        f"the switch `{name}` is reserved for tiers 2 and 3, and no shipped mission has it yet",
        hint="noisy positions and motions are channels today: `observes uav.gnss, uav.imu` (docs/sensors.md)",
        faults=(Fault(f"settings.{name}", f"the switch `{name}` is reserved for tiers 2 and 3"),),
    )


def _undeclared(mission: model.Mission, tier: int) -> UsageError:
    known = tiers_of(mission)
    if not 0 <= tier <= HIGHEST:
        message, hint = f"there is no tier {tier}", f"tiers are 0 to {HIGHEST}"
    elif len(known) == 1:
        message = f"mission '{mission.name}' declares no tier {tier}"
        hint = "it can be played at tier 0; `tier 1 { … }` in its text declares another"
    else:
        message = f"mission '{mission.name}' declares no tier {tier}"
        hint = f"it has the tiers {', '.join(map(str, known))}"
    if PLAYED < tier <= HIGHEST:
        hint += f"; tiers 2 and 3 are reserved for {RESERVED}"
    return UsageError(message, hint=hint, faults=(Fault("tier", message, hint),))
