"""The form in which a boundary record is hashed: the covered fields under frozen names, for each version.

A digest must change when a result changes, and only then. The form is therefore declared here and not derived from the
record types. A renamed field keeps its `key`. A new field with a default leaves every stored digest unchanged. A
reworded message changes nothing. The test `test_the_form_covers_every_field` fails for a field without a row here.

Version 1 (traces without `Header.digest_version`) is the JSON of the whole record, with defaults and free text, and
with derived fields blanked. Version 2 leaves out derived fields, free text and values that equal their default. A
released row is never changed or removed. A new meaning needs a new version (ADR 0029).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import msgspec

from lingjing.mission.instance import Weather
from lingjing.trace import records
from lingjing.trace.records import DigestVersion

REQUIRED: Final = object()
"""Marks a field without a default, which is always written."""

RecordForm = dict[str, object]
"""The form of one record: plain values under frozen names."""


@dataclass(frozen=True, slots=True)
class FormField:
    """One field of a record type."""

    key: str
    """The frozen name."""
    default: object = REQUIRED
    """The value that version 2 leaves out."""
    attribute: str = ""
    """The present name of the attribute; "" if it equals `key`."""
    derived: bool = False
    """True if the value is computed from other fields, or is wall clock, pixels or free text. Version 2 leaves it
    out."""
    blank: object = REQUIRED
    """The value that version 1 writes for a derived field. `REQUIRED`: it writes the value itself."""
    nested: type[msgspec.Struct] | None = None
    """The record type of the value or of its elements. None for plain values."""
    since: DigestVersion = 1
    """The first version with the field."""

    @property
    def name(self) -> str:
        """The name of the record's attribute."""
        return self.attribute or self.key


def _free_text(key: str) -> FormField:
    """Return the row of a free text, which version 1 covers and version 2 does not."""
    return FormField(key, derived=True)


def _blanked(key: str, blank: object) -> FormField:
    """Return the row of a derived value, which version 1 writes as `blank`."""
    return FormField(key, derived=True, blank=blank)


FORMS: Final[Mapping[type[msgspec.Struct], tuple[FormField, ...]]] = {
    records.BodyState: (
        FormField("id"),
        FormField("position"),
        FormField("velocity", (0.0, 0.0, 0.0)),
        FormField("heading_deg", 0.0),
        FormField("pitch_deg", 0.0),
        FormField("roll_deg", 0.0),
        FormField("status", ""),
        FormField("resources", {}),
        FormField("kind", ""),
        FormField("joints", ()),
    ),
    records.Action: (
        FormField("verb"),
        FormField("arguments", {}),
        FormField("resource", None),
        FormField("tick", None),
    ),
    records.Outgoing: (FormField("kind"), FormField("body", {}), FormField("to", ())),
    records.Usage: (
        FormField("calls", 0),
        FormField("prompt_tokens", 0),
        FormField("completion_tokens", 0),
        FormField("cost_usd", derived=True),  # follows from the tokens and from a table of prices
        FormField("answers", 0),
        FormField("valid_answers", 0),
        FormField("unread_boxes", derived=True),  # follow from answers that decided nothing
    ),
    records.Decision: (
        FormField("command", None, nested=records.Action),
        FormField("messages", (), nested=records.Outgoing),
        _free_text("thought"),
        FormField("usage", None, nested=records.Usage),
    ),
    records.Command: (
        FormField("id"),
        FormField("tick"),
        FormField("sender"),
        FormField("resource"),
        FormField("verb"),
        FormField("arguments", {}),
        FormField("origin", "agent"),
    ),
    records.Receipt: (
        FormField("request"),
        FormField("tick"),
        FormField("sender"),
        FormField("resource"),
        FormField("status"),
        FormField("reason", ""),
        _free_text("detail"),
        FormField("by", "kernel"),
        FormField("time_s", 0.0),
        FormField("progress", None),
    ),
    records.TaskEvent: (
        FormField("kind"),
        FormField("entities"),
        FormField("time_s"),
        FormField("values", {}),
        FormField("name", ""),
        FormField("word", "", since=2),
    ),
    records.Route: (
        FormField("entity"),
        FormField("number"),
        FormField("waypoints"),
        FormField("length_m"),
        FormField("duration_s"),
        FormField("time_s"),
        FormField("request", ""),
    ),
    records.Snapshot: (
        FormField("time_s"),
        FormField("states", nested=records.BodyState),
        FormField("ambient", (), nested=records.BodyState),
    ),
    records.Box: (
        FormField("entity"),
        FormField("cls"),
        FormField("box"),
        FormField("pixels"),
        FormField("contrast", None),
    ),
    records.CameraPose: (
        FormField("position"),
        FormField("heading_deg"),
        FormField("tilt_deg"),
        FormField("roll_deg", 0.0),
        FormField("hfov_deg", 84.0),
        FormField("width", 1920),
        FormField("height", 1080),
    ),
    records.FrameInfo: (
        FormField("id"),
        FormField("entity"),
        FormField("camera"),
        FormField("tick"),
        FormField("time_s"),
        FormField("pose", nested=records.CameraPose),
        FormField("channels"),
        FormField("boxes", (), nested=records.Box),
        FormField("faint", (), nested=records.Box),
        _blanked("sha256", ""),
        _blanked("channels_sha256", ""),
        _blanked("renderer", ""),
        FormField("instance_ids", {}, derived=True, since=2),  # follows from the pixels
        FormField("others", (), derived=True, nested=records.Box, since=2),  # follows from the pixels
    ),
    records.Absent: (FormField("entity"), FormField("camera"), FormField("tick"), FormField("reason")),
    records.Envelope: (
        FormField("id"),
        FormField("tick"),
        FormField("sender"),
        FormField("recipient"),
        FormField("kind"),
        FormField("category"),
        FormField("body"),
        FormField("bytes"),
        FormField("deliver_at"),
    ),
    records.AdjudicatedEvent: (
        FormField("id"),
        FormField("kind"),
        FormField("tick"),
        FormField("time_s"),
        FormField("bindings"),
        FormField("evidence", {}),
    ),
    records.StageChange: (FormField("stage"), FormField("subject"), FormField("tick"), FormField("time_s")),
    records.EntityView: (
        FormField("id"),
        FormField("type"),
        FormField("position", None),
        FormField("velocity", None),
        FormField("heading_deg", None),
        FormField("status", None),
        FormField("resources", None),
        FormField("busy", None),
        FormField("route", None),
        FormField("assignment", None, derived=True, since=2),  # follows from the commands and their receipts
        FormField("specific_force", None, since=2),
        FormField("angular_rate", None, since=2),
    ),
    records.CellView: (
        FormField("name"),
        FormField("visited_tick", None),
        FormField("visited_by", None),
        FormField("seen", None, derived=True, since=2),  # follows from the poses of the pictures
    ),
    records.EventView: (FormField("id"), FormField("kind"), FormField("tick"), FormField("entities")),
    Weather: (
        FormField("wind_mps", 0.0),
        FormField("wind_from_deg", 0.0),
        FormField("turbulence", 0.0),
        FormField("visibility_m", 10_000.0),
        FormField("wave_height_m", 0.0),
        FormField("wave_period_s", 5.0),
        FormField("current_mps", 0.0),
        FormField("current_to_deg", 0.0),
        FormField("cloud", 0.2),
        FormField("rain", 0.0),
        FormField("sun_azimuth_deg", 150.0),
        FormField("sun_elevation_deg", 45.0),
        FormField("ice", 0.0, since=2),
        FormField("effects", False, since=2),
    ),
    records.ObservationRecord: (
        FormField("agent"),
        FormField("entities", (), nested=records.EntityView),
        FormField("cells", (), nested=records.CellView),
        FormField("events", (), nested=records.EventView),
        FormField("frames", ()),
        FormField("absent", (), nested=records.Absent),
        FormField("privileged", False),
        _blanked("sha256", ""),
        FormField("weather", None, nested=Weather),
    ),
    records.InboxRecord: (
        FormField("agent"),
        FormField("messages", ()),
        FormField("receipts", (), nested=records.Receipt),
    ),
    records.DecisionRecord: (
        FormField("agent"),
        FormField("decision", nested=records.Decision),
        FormField("substituted", ""),
        _free_text("detail"),
        _blanked("policy_wall_s", 0.0),
    ),
    records.EngineStatus: (
        FormField("engine"),
        FormField("time_s"),
        FormField("frame"),
        _blanked("wait_wall_s", 0.0),
    ),
    records.BoundaryRecord: (
        FormField("tick"),
        FormField("time_s"),
        FormField("snapshots", nested=records.Snapshot),
        FormField("engines", nested=records.EngineStatus),
        FormField("task_events", (), nested=records.TaskEvent),
        FormField("frames", (), nested=records.FrameInfo),
        FormField("observations", (), nested=records.ObservationRecord),
        FormField("inboxes", (), nested=records.InboxRecord),
        FormField("decisions", (), nested=records.DecisionRecord),
        FormField("commands", (), nested=records.Command),
        FormField("messages", (), nested=records.Envelope),
        FormField("receipts", (), nested=records.Receipt),
        FormField("events", (), nested=records.AdjudicatedEvent),
        FormField("stages", (), nested=records.StageChange),
        _blanked("relations", ()),
        FormField("reward"),
        FormField("done"),
        FormField("scr", 0.0),
        _blanked("digest", ""),
        _blanked("wall_s", 0.0),
        FormField("routes", (), nested=records.Route),
        FormField("unheard", (), attribute="unreachable_links"),
    ),
}
"""The fields of every record type in a boundary, in the order in which version 1 writes them."""

_CURRENT: Final = {
    kind: tuple((row.name, row.key, row.default, row.nested is not None) for row in rows if not row.derived)
    for kind, rows in FORMS.items()
}
"""The rows of version 2 in the shape that `current_form` needs: attribute, key, default, nested or not."""


def current_form(record: msgspec.Struct) -> RecordForm:
    """Return the form of version 2. `record` must be normalised (`lingjing.trace.encoding.normalise`)."""
    plain: RecordForm = {}
    for name, key, default, nested in _CURRENT[type(record)]:
        value = getattr(record, name)
        if value == default:
            continue
        plain[key] = _nested(value, type(value), current_form) if nested else value
    return plain


def full_form(record: msgspec.Struct) -> RecordForm:
    """Return the form of version 2 with default values included, to describe the differences of two records."""
    return {
        row.key: _nested(getattr(record, row.name), row.nested, full_form)
        for row in FORMS[type(record)]
        if not row.derived
    }


def first_form(record: msgspec.Struct) -> RecordForm:
    """Return the form of version 1, with its order of keys. `record` must be normalised."""
    return {
        row.key: _nested(getattr(record, row.name), row.nested, first_form) if row.blank is REQUIRED else row.blank
        for row in FORMS[type(record)]
        if row.since == 1
    }


def _nested(value: object, kind: type[msgspec.Struct] | None, form: Callable[[msgspec.Struct], RecordForm]) -> object:
    if kind is None or value is None:
        return value
    if isinstance(value, tuple):
        return [form(item) for item in value]
    assert isinstance(value, msgspec.Struct)
    return form(value)
