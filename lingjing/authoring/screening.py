"""`screen`: tests a composed mission and returns its certificate.

A mission is certified if its text validates, the draws of its seeds cover their regions and are all different, `idle`
and `random` lose, and `oracle` wins. The cheap tests come first, and the first failure ends the screening, so that a
certificate without success names one reason. A certificate holds no time, so that equal code gives equal certificates.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Literal

import msgspec

from lingjing.authoring.checks import MissionCheck, checks_of
from lingjing.authoring.composing import VERSION, Composed, compose
from lingjing.authoring.running import CheckResult, CheckRunner
from lingjing.decoding import from_json
from lingjing.dsl.compilation import compile_text
from lingjing.errors import InfrastructureError
from lingjing.mission import model
from lingjing.mission.instantiate import instantiate
from lingjing.whole_files import written_whole

Verdict = Literal["certified", "invalid", "draws", "unplaced", "idle", "random", "oracle", "aborted"]
"""`certified`, or the test that failed: the text does not validate, draws do not spread or repeat, an instance has no
place in its city, a policy that should lose does not, the oracle does not win, or the infrastructure aborted an
episode."""

DRAWS = 20
"""Seeds with instances that must all differ (chosen)."""
REJECTED = "rejected"
"""The folder of missions without a certificate of success."""


class CertifiedCheck(msgspec.Struct, frozen=True, kw_only=True):
    """The result of one expectation."""

    text: str
    state: str
    summary: str
    episodes: int


class Certificate(msgspec.Struct, frozen=True, kw_only=True):
    """The record beside a composed mission."""

    mission: str
    seed: int
    """The seed of the composition."""
    generator: int
    """The version of the composition."""
    sha256: str
    """SHA-256 of the mission's text, hexadecimal."""
    verdict: Verdict
    reason: str
    """The reason for a verdict other than `certified`; "" for that."""
    plan: str
    bodies: tuple[str, ...]
    errands: tuple[str, ...]
    mode: str
    ticks: int
    checks: tuple[CertifiedCheck, ...] = ()
    """The expectations that were run, in their order."""


def generate(seed: int, folder: Path, runner: CheckRunner) -> Certificate:
    """Compose the mission of a seed, screen it, and write text and certificate into the folder.

    A mission that fails is written into the folder `rejected` there. A certificate that the folder holds for the same
    text is returned, and nothing is run. Raises `InfrastructureError` for an aborted screening, and `OSError` if a file
    cannot be written.
    """
    composed = compose(seed)
    known = _known(composed, folder)
    if known is not None:
        return known
    certificate = screen(seed, composed, runner)
    if certificate.verdict == "aborted":
        raise InfrastructureError(f"`{composed.name}` could not be screened: {certificate.reason}")
    place = folder if certificate.verdict == "certified" else folder / REJECTED
    place.mkdir(parents=True, exist_ok=True)
    encoded = msgspec.json.format(msgspec.json.encode(certificate), indent=2) + b"\n"
    for name, content in ((f"{composed.name}.ljs", composed.text.encode()), (f"{composed.name}.json", encoded)):
        with written_whole(place / name) as partial:
            partial.write_bytes(content)
    return certificate


def screen(seed: int, composed: Composed, runner: CheckRunner) -> Certificate:
    """Test a composed mission. Its file is written into the runner's folder."""
    compilation = compile_text(composed.text, path=f"{composed.name}.ljs")

    def certificate(verdict: Verdict, reason: str = "", checks: tuple[CertifiedCheck, ...] = ()) -> Certificate:
        return Certificate(
            mission=composed.name, seed=seed, generator=VERSION, sha256=_sha256(composed), verdict=verdict,
            reason=reason, plan=composed.plan, bodies=composed.bodies, errands=composed.errands, mode=composed.mode,
            ticks=composed.ticks, checks=checks,
        )  # fmt: skip

    mission = compilation.mission
    if mission is None:
        first = next(item for item in compilation.diagnostics if item.severity == "error")
        return certificate("invalid", f"{first.code}: {first.message}")
    repeated = _repeated_draw(mission)
    if repeated:
        return certificate("draws", repeated)
    path = runner.folder / _sha256(composed) / f"{composed.name}.ljs"  # a runner identifies episodes by the path
    path.parent.mkdir(exist_ok=True)
    path.write_text(composed.text, encoding="utf-8")
    done: list[CertifiedCheck] = []
    for check in sorted(checks_of(path.name, path, mission), key=_cost):
        result = runner.run(check)
        done.append(_certified(check, result))
        if result.state != "passed":
            return certificate(_verdict(check, result), _reason(check, result), tuple(done))
    return certificate("certified", checks=tuple(done))


# -- private


def _cost(check: MissionCheck) -> int:
    expectation = check.expectation
    return _ORDER.index(expectation.policy) if isinstance(expectation, model.PolicyExpectation) else -1


_ORDER = ("idle", "oracle", "random")
"""The policies of composed missions, in the order of screening: the oracle loses more missions than `random` wins."""


def _verdict(check: MissionCheck, result: CheckResult) -> Verdict:
    if result.state == "aborted":
        return "aborted"
    if not isinstance(check.expectation, model.PolicyExpectation):
        return "draws"
    if result.state == "error":
        return "unplaced"
    verdicts: dict[str, Verdict] = {"idle": "idle", "random": "random", "oracle": "oracle"}
    return verdicts[check.expectation.policy]


def _reason(check: MissionCheck, result: CheckResult) -> str:
    happened = next((line for line in result.details if line.startswith("seed ")), "")
    return f"{check.text}: {result.summary}{f'; {happened}' if happened else ''}"


def _certified(check: MissionCheck, result: CheckResult) -> CertifiedCheck:
    return CertifiedCheck(text=check.text, state=result.state, summary=result.summary, episodes=result.episodes)


def _repeated_draw(mission: model.Mission) -> str:
    """The two seeds with equal instances, in words; "" if all differ."""
    seen: dict[tuple[object, ...], int] = {}
    for seed in range(DRAWS):
        instance = instantiate(mission, seed=seed)
        key = tuple(entity.position for entity in instance.entities)
        if key in seen:
            return f"seeds {seen[key]} and {seed} draw the same places"
        seen[key] = seed
    return ""


def _sha256(composed: Composed) -> str:
    return hashlib.sha256(composed.text.encode()).hexdigest()


def _known(composed: Composed, folder: Path) -> Certificate | None:
    """The certificate that the folder holds for this text."""
    for place in (folder, folder / REJECTED):
        file = place / f"{composed.name}.json"
        try:
            certificate = from_json(file.read_bytes(), Certificate)
        except (OSError, msgspec.DecodeError):
            continue
        if certificate.sha256 == _sha256(composed) and certificate.generator == VERSION:
            return certificate
    return None
