"""The audit of results: every kept trace is verified, scored again and compared with its row, and a sample is replayed.

An audit confirms rows and finds those that are not what they claim. It says what it cannot check: rows without a trace,
traces that cannot be replayed here, and answers of models, which it can only compare with their record.
"""

from __future__ import annotations

import math
import random
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import NamedTuple

import msgspec

from lingjing.bench.evidence import AuditMark, AuditRecord, named, row_faults, row_sha256
from lingjing.bench.rows import SuiteRow, code_sha256
from lingjing.bench.suite import find_suite, mission_files_of, shipped_suites
from lingjing.bench.version import benchmark_version, mission_version
from lingjing.causal.replay import replay
from lingjing.decoding import from_json
from lingjing.dsl.loading.load import load_mission
from lingjing.dsl.loading.shipped import find_mission, shipped_missions
from lingjing.errors import LingjingError
from lingjing.kernel.cities import CityBuilder
from lingjing.mission.instance import Instance
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission
from lingjing.mission.salts import Salt, public_seed, salt_fault
from lingjing.play.options import deciding_options, without_folder
from lingjing.play.report import ABORTED, EpisodeReport, report_of
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import content_sha256
from lingjing.trace.call_store import CALLS_NAME, CallReader
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import Header
from lingjing.trace.seal_check import last_chain
from lingjing.trace.verification import verify_file

LEAST_SHARE = 0.05
"""The smallest share of traces that an audit replays."""

NOT_KEPT = "its trace was not kept (`bench --keep` keeps traces)"
REMOVED = "its trace was removed"
REMOVED_SINCE = "its trace was removed after an earlier audit had confirmed it (--keep-marks)"
NO_TRACE = "its episode has no trace: the policy failed before it began"
OTHER_CODE = "it was played with other code, so that only its own replay confirms it (--share 1)"
NOT_SHIPPED = "its rules, except against other rows: its mission is not shipped (--suite FILE)"
OTHER_ENTITIES = "the places of its entities: it was played with other code"
OTHER_VERSIONS = "its versions of the benchmark, the mission and the code: it was played with other code"
OTHER_RULES = "its rules: they differ from those of its mission, and it was played with other code"
ABORT_REMOVED = "its abort, which has no complete trace"
OTHER_CITY = "its rules, except against other rows: it was played in another city"
OLDER_TRACE = "its options such as `blank_pictures`: its trace is from before traces had them"
OTHER_SUITE = "the hash of its code: another mission of its suite has changed since"
OTHER_MISSIONS = "its versions of the mission and of the code: they are not those of a shipped suite (--suite FILE)"
"""The reasons for which a row cannot be checked, or not wholly."""

_COMPARED = ("mission", "mode", "seed", "policy_seed", "tier", "language", "success", "reason", "scr", "score", "ticks",
             "digest", "frames_digest", "metrics", "family", "terciles", "perceived", "privileged")  # fmt: skip
"""The fields of a report that follow from its trace alone. Wall-clock seconds in `metrics` do as well."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A row that is not what it claims."""

    row: SuiteRow
    reason: str


@dataclass(slots=True)
class Audit:
    """The result of an audit."""

    marks: dict[str, AuditMark] = field(default_factory=dict)
    """The confirmed rows, by their hash."""
    findings: list[Finding] = field(default_factory=list)
    """The rows that are not what they claim."""
    unchecked: Counter[str] = field(default_factory=Counter)
    """The reasons for which rows were not checked, or not wholly, with the number of rows."""
    replayed: int = 0
    """The number of replayed traces."""
    checked: int = 0
    """The number of checked traces."""

    def record(self, code: str) -> AuditRecord:
        """Return the result as it is stored."""
        return AuditRecord(
            rows=self.marks,
            faults={row_sha256(finding.row): finding.reason for finding in self.findings},
            unchecked=dict(self.unchecked),
            share=self.replayed / self.checked if self.checked else 0.0,
            code=code,
        )


@dataclass
class Auditor:
    """Audits the rows of one results folder."""

    folder: Path
    """The folder of the traces."""
    code: str
    """The SHA-256 of the code here, without missions (`SuiteRow.harness`)."""
    share: float = LEAST_SHARE
    """The share of checked traces to replay."""
    seed: int | None = None
    """The seed of the sample; None for one that cannot be foreseen."""
    salt: Salt | None = None
    """The published salt of a sealed split; None to leave it unchecked."""
    suite: Path | None = None
    """The suite's file; None for the shipped suite of that name."""
    earlier: AuditRecord = field(default_factory=lambda: AuditRecord(rows={}))
    """An earlier audit: rows keep its marks and its faults when their traces were removed since."""
    tell: Callable[[str], None] = field(default=lambda line: None)
    """Receives a line for each checked row."""
    _rules: dict[tuple[object, ...], tuple[SuiteRow, dict[str, object]]] = field(default_factory=dict)
    """The first row of each instance without a known mission, with its rules."""

    def audit(self, rows: Sequence[SuiteRow]) -> Audit:
        """Audit the rows. An aborted try is a finding if it contradicts itself, or if its trace has a result."""
        audit = Audit()
        counted = [row for row in rows if row.standing == "counted"]
        audit.findings += self._repeated_traces(counted)
        audit.findings += self._wrong_aborts(rows, audit)
        audit.findings += self._other_versions(counted, audit)
        for row in counted:
            self._check(row, audit)
        confirmed = [row for row in counted if row_sha256(row) in audit.marks]
        audit.checked = len(confirmed)
        for row in self._sample(confirmed):
            self._replay(row, audit)
        for row in confirmed:
            if row.harness != self.code and audit.marks.get(row_sha256(row)) == "checked":
                del audit.marks[row_sha256(row)]
                audit.unchecked[OTHER_CODE] += 1
        wrong = {row_sha256(finding.row) for finding in audit.findings}
        for name in {row_sha256(row) for row in counted if self._is_removed(row)} - wrong:
            if name in self.earlier.rows:
                audit.marks[name] = self.earlier.rows[name]
        return audit

    def _repeated_traces(self, rows: Sequence[SuiteRow]) -> Iterator[Finding]:
        """Yield a finding for each row that has the seal of another row's trace."""
        first: dict[str, SuiteRow] = {}
        for row in rows:
            if row.seal and first.setdefault(row.seal, row) is not row:
                yield Finding(row, f"its trace is that of {named(first[row.seal])}")

    @cached_property
    def _cities(self) -> CityBuilder:
        return CityBuilder(PluginHost())

    @cached_property
    def _missions(self) -> dict[str, Path]:
        """The mission files of the named suite, by the names of the missions."""
        files = mission_files_of(self.suite) if self.suite is not None else ()
        return {_loaded(file).name: file for file in files}

    def _wrong_aborts(self, rows: Sequence[SuiteRow], audit: Audit) -> Iterator[Finding]:
        """Yield a finding for each aborted try that contradicts itself, or that has a trace with a result."""
        for row in rows:
            if row.standing == "counted":
                continue
            outcome = None
            if _is_there(self.folder / row.report.trace):
                with suppress(LingjingError):
                    outcome = read_trace(self.folder / row.report.trace).outcome
            fault = next(row_faults(row), "")
            if not fault and outcome is not None and outcome.reason != ABORTED:
                fault = f"it is {row.standing}, and its trace ends with `{outcome.reason}`"
            if fault:
                yield Finding(row, fault)
            elif outcome is None:
                audit.unchecked[ABORT_REMOVED] += 1

    def _other_versions(self, rows: Sequence[SuiteRow], audit: Audit) -> Iterator[Finding]:
        """Yield a finding for each row of this code with versions that its suite's missions do not give."""
        for suite, own in _by(rows, lambda row: row.suite):
            files = list(self._missions.values()) or _shipped_files(suite)
            code = code_sha256(files)
            missions = {_loaded(file).name: mission_version(file) for file in files}
            for row in own:
                if row.harness != self.code:
                    audit.unchecked[OTHER_VERSIONS] += 1
                elif row.benchmark != benchmark_version():
                    yield Finding(row, "its version of the benchmark is not that of the code")
                elif row.mission_sha256 == missions.get(row.mission):
                    if row.code != code:
                        audit.unchecked[OTHER_SUITE] += 1
                elif self.suite is not None:
                    yield Finding(row, "its version of the mission is not that of its suite")
                else:
                    audit.unchecked[OTHER_MISSIONS] += 1

    def _check(self, row: SuiteRow, audit: Audit) -> None:
        """Check one row without a replay, and mark it if its trace confirms it."""
        if any(finding.row is row for finding in audit.findings):
            return
        fault = next(row_faults(row), "")
        path = self.folder / row.report.trace
        if not fault and not row.report.trace:
            reason = NO_TRACE if not row.report.digest else NOT_KEPT
        elif not fault and self._is_removed(row):
            fault = self.earlier.faults.get(row_sha256(row), "")
            reason = "" if fault else REMOVED_SINCE if row_sha256(row) in self.earlier.rows else REMOVED
        else:
            reason = ""
            fault = fault or self._trace_fault(row, path, audit)
        if fault:
            audit.findings.append(Finding(row, fault))
        elif reason:
            audit.unchecked[reason] += 1
        else:
            audit.marks[row_sha256(row)] = "checked"
        self.tell(f"{named(row)}: {fault or reason or 'confirmed by its trace'}")

    def _is_removed(self, row: SuiteRow) -> bool:
        return bool(row.report.trace) and not _is_there(self.folder / row.report.trace)

    def _trace_fault(self, row: SuiteRow, path: Path, audit: Audit) -> str:
        """Return the first difference between a row and its trace; "" if there is none."""
        try:
            verified = verify_file(path)
            if verified.state != "ok":
                return f"its trace is {verified.state}: {verified.said}"
            if row.seal != last_chain(path):
                return "its seal is not that of its trace" if row.seal else "it names no seal of its trace"
            trace = read_trace(path)
        except LingjingError as error:
            return f"its trace cannot be read: {error}"
        return (
            _header_fault(row, trace)
            or _options_fault(row, trace, audit)
            or self._rules_fault(row, trace, audit)
            or _report_fault(row.report, report_of(trace, row.report.policy))
            or self._split_fault(row, trace, audit)
            or _calls_fault(row, path.parent, audit)
            or self._difference_to_others(row, trace, audit)
        )

    def _file_of(self, row: SuiteRow) -> Path | None:
        """Return the file of a row's mission; None if it is not known, or was played in another city."""
        file = self._missions.get(row.mission)
        if file is None and row.mission in shipped_missions():
            file = find_mission(row.mission)
        return None if row.options.scene else file

    def _rules_fault(self, row: SuiteRow, trace: Trace, audit: Audit) -> str:
        """Return the first difference between the instance in a trace and that which its mission gives."""
        played, file = trace.header.instance, self._file_of(row)
        if file is None:
            return ""
        try:
            drawn = instantiate(
                _loaded(file), seed=played.seed, mode=played.mode, settings=row.options.settings, tier=played.tier,
                language=played.language,
            )  # fmt: skip
        except LingjingError as error:
            fault = f"its mission gives no such instance: {error}"
        else:
            name = next((name for name in _RULES if getattr(drawn, name) != getattr(played, name)), "")
            fault = f"its {name} is not that of its mission" if name else ""
        if row.harness != self.code:
            audit.unchecked[OTHER_RULES if fault else OTHER_ENTITIES] += 1
            return ""
        if fault:
            own = f", the shipped `{row.mission}` (--suite FILE names a suite with its own)"
            return fault if row.mission in self._missions else f"{fault}{own}"
        return self._places_fault(drawn, _loaded(file), trace.header, audit)

    def _places_fault(self, drawn: Instance, mission: Mission, header: Header, audit: Audit) -> str:
        """Return the first difference between the placed entities and city in a trace and those of its instance."""
        try:
            placed, city = self._cities.place(drawn, imported=bool(mission.origin.places))
        except LingjingError as error:  # a map or a foreign scene may be missing here
            audit.unchecked[f"the places of its entities: {error}"] += 1
            return ""
        if placed.entities != header.instance.entities:
            return "its entities are not those of its mission"
        return "" if content_sha256(city) == header.city_sha256 else "its city is not that of its mission"

    def _difference_to_others(self, row: SuiteRow, trace: Trace, audit: Audit) -> str:
        """Return the first difference between the rules in a trace and those of an earlier row of the same instance, if
        the mission is not known.

        Both rows are then wrong, because nothing says which of them is right.
        """
        if self._file_of(row) is not None:
            return ""
        played, options = trace.header.instance, row.options
        audit.unchecked[OTHER_CITY if options.scene else NOT_SHIPPED] += 1
        rules = {name: getattr(played, name) for name in _RULES}
        key = (row.mission, row.mode, row.tier, row.language, row.split_sha256, row.seed, options.scene,
               tuple(sorted(options.settings.items())))  # fmt: skip
        first, theirs = self._rules.setdefault(key, (row, rules))
        name = next((name for name in _RULES if rules[name] != theirs[name]), "")
        if name and audit.marks.pop(row_sha256(first), None) is not None:
            audit.findings.append(Finding(first, f"its {name} is not that of {named(row)}"))
        return f"its {name} is not that of {named(first)}" if name else ""

    def _split_fault(self, row: SuiteRow, trace: Trace, audit: Audit) -> str:
        """Return the fault of the instance of a sealed split."""
        header = trace.header
        if row.split_sha256 != header.fingerprint.get("salt", ""):
            return "its sealed split is not that of its trace"
        if not row.split_sha256:
            return ""
        if self.salt is None:
            audit.unchecked["its instance, without the published salt (--salt FILE)"] += 1
            return ""
        return salt_fault(self.salt, header.fingerprint, header.instance.seed)

    def _sample(self, rows: Sequence[SuiteRow]) -> list[SuiteRow]:
        """Draw the rows to replay: at least the share, and at least one."""
        count = min(len(rows), max(1, -int(-len(rows) * self.share // 1)))
        drawing = random.SystemRandom() if self.seed is None else random.Random(self.seed)
        return drawing.sample(list(rows), count)

    def _replay(self, row: SuiteRow, audit: Audit) -> None:
        """Replay one trace, and mark its row."""
        try:
            replayed = replay(read_trace(self.folder / row.report.trace))
        except LingjingError as error:
            audit.unchecked[f"its replay: {error}"] += 1
            self.tell(f"{named(row)}: cannot be replayed here: {error}")
            return
        if replayed.difference is None and replayed.ends:
            audit.marks[row_sha256(row)] = "replayed"
            audit.replayed += 1
            self.tell(f"{named(row)}: confirmed by a replay")
            return
        del audit.marks[row_sha256(row)]
        if row.harness != self.code:
            audit.unchecked["its replay: it was played with other code, and differs here"] += 1
            self.tell(f"{named(row)}: differs in a replay with other code")
            return
        difference = replayed.difference
        where = "it has no end" if difference is None else f"`{difference.field}` at boundary {difference.boundary}"
        audit.findings.append(Finding(row, f"a replay differs from its trace: {where}"))
        self.tell(f"{named(row)}: differs in a replay: {where}")


def _is_there(path: Path) -> bool:
    """Return whether the path names a file. The name is that of a row, and may be anything."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _header_fault(row: SuiteRow, trace: Trace) -> str:
    """Return the first difference between the options of a row and the header of its trace."""
    header, options = trace.header, row.options
    played: Mapping[str, tuple[object, object]] = {
        "mission": (row.mission, header.instance.mission),
        "mode": (row.mode, header.instance.mode),
        "seed": (row.seed, public_seed(header.fingerprint, header.instance.seed)),
        "policy seed": (row.policy_seed, header.policy_seed),
        "tier": (row.tier, header.instance.tier),
        "language": (row.language, header.instance.language),
        "evaluators": (options.evaluators, header.evaluators),
        "policy": (bool(options.policies_for) or row.policy in {binding.policy for binding in header.bindings}, True),
        "option seed": (options.seed, row.seed),
        "option policy_seed": (options.policy_seed, row.policy_seed),
        "option mode": (options.mode, row.mode),
        "option policy": (_is_spec_of(row.policy, options.policy), True),
        "reported policy": (_is_spec_of(row.policy, row.report.policy), True),
        "walls": (options.isolate != "no", bool(header.fingerprint.get("walls"))),
    }
    for name, (claimed, recorded) in played.items():
        if claimed != recorded:
            return f"its {name} is not that of its trace ({recorded})"
    arguments = {name: value for binding in header.bindings for name, value in binding.arguments.items()}
    for name, value in arguments.items():
        if name in options.policy_args and options.policy_args[name] != value:
            return f"its option `{name}` is not that of its trace"
    return ""


def _is_spec_of(policy: str, spec: str) -> bool:
    """Return whether a policy's name is that of a spec: `agent.py:Agent` may be given as `./agent.py`."""
    return policy == without_folder(spec) or policy.startswith(f"{without_folder(spec)}:")


def _options_fault(row: SuiteRow, trace: Trace, audit: Audit) -> str:
    """Return the first option of a row that is not that of its trace."""
    recorded = trace.header.options
    if recorded is None:
        audit.unchecked[OLDER_TRACE] += 1
        return ""
    claimed = deciding_options(row.options)
    for name in sorted(claimed.keys() | recorded.keys()):
        if claimed.get(name) != recorded.get(name):
            return f"its option `{name}` is not that of its trace"
    return ""


def _by(rows: Iterable[SuiteRow], key: Callable[[SuiteRow], str]) -> list[tuple[str, list[SuiteRow]]]:
    """Return the rows in groups with equal keys, in the order of their first rows."""
    groups: dict[str, list[SuiteRow]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return list(groups.items())


_RULES = ("goal", "settings", "clock", "budget", "weather", "regions", "cells", "agents", "messages", "comms", "rules",
          "unlocks", "stages", "relations", "success", "failure", "limits", "permits", "constraints", "inspections",
          "reveals")  # fmt: skip
"""The fields of an instance that follow from mission, seed, mode, tier and settings alone, and decide the outcome."""


@cache
def _loaded(file: Path) -> Mission:
    return load_mission(file)


def _shipped_files(suite: str) -> list[Path]:
    """Return the mission files of a shipped suite; none for another suite."""
    if suite not in shipped_suites():
        return []
    return mission_files_of(find_suite(suite))


def _report_fault(claimed: EpisodeReport, scored: EpisodeReport) -> str:
    """Return the first difference between a row's report and that of its trace, scored again."""
    for name in _COMPARED:
        here, there = (msgspec.to_builtins(getattr(report, name)) for report in (claimed, scored))
        if here != there:
            return f"its {name} is not what its trace gives" + (f" ({there})" if not isinstance(there, dict) else "")
    return ""


def _calls_fault(row: SuiteRow, folder: Path, audit: Audit) -> str:
    """Compare the record of model calls with the row: the number of answers, tokens, cost, and every stored text.

    A call that was given up at a deadline may be in the row or not: in the last turn no report follows it.
    """
    metrics, file = row.report.metrics, folder / CALLS_NAME
    if metrics is None or not (metrics.calls or _is_there(file)):
        return ""
    if not _is_there(file):
        audit.unchecked["its model calls, which have no record"] += 1
        return ""
    try:
        held = _recorded(file)
    except (LingjingError, msgspec.MsgspecError, ValueError) as error:
        return f"its record of model calls is wrong: {error}"
    if metrics.tokens != held.tokens or not held.calls - held.abandoned <= metrics.calls <= held.calls:
        claimed = f"the row {metrics.calls} with {metrics.tokens}"
        return f"its record holds {held.calls} model calls with {held.tokens} tokens, and {claimed}"
    if not math.isclose(metrics.cost_usd, held.cost_usd, rel_tol=1e-6, abs_tol=1e-9):
        return f"its record holds model calls for ${held.cost_usd:.6f}, and the row claims ${metrics.cost_usd:.6f}"
    return (
        "" if row.served == held.served else f"its record names the model `{held.served}`, and the row `{row.served}`"
    )


class _Recorded(NamedTuple):
    """The sums of a record of model calls."""

    calls: int
    abandoned: int
    """Calls that were given up at a deadline, also in `calls`."""
    tokens: int
    cost_usd: float
    served: str


def _recorded(file: Path) -> _Recorded:
    """Read every text and picture of a record, and sum its calls. Raises `LingjingError`, `MsgspecError` or
    `ValueError` for what cannot be read.
    """
    reader = CallReader(file)
    try:
        results = []
        for call in reader.calls():
            for message in (call.head, *call.messages):
                from_json(message)
            for picture in call.pictures:
                reader.content(bytes.fromhex(picture))
            if call.tick >= 0 and call.result is not None:
                results.append(call.result)
        return _Recorded(
            calls=sum(result.attempts for result in results),
            abandoned=sum(result.attempts for result in results if result.fault == "abandoned"),
            tokens=sum(result.prompt_tokens + result.completion_tokens for result in results),
            cost_usd=sum(result.cost_usd or 0.0 for result in results),
            served=", ".join(reader.served()),
        )
    finally:
        reader.close()


__all__ = ["LEAST_SHARE", "Audit", "Auditor", "Finding"]
