"""Names and forms of LJ-ENGINE messages: commands, acknowledgements, results, failures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple

Document = Mapping[str, object]
"""A JSON object of a foreign program."""

EXTENSION = "lingjing"
"""The field of commands, queries and results that processes of this project add. Others pass over it."""
EXTENSION_VERSION = 1

SUBSCRIBE, UNSUBSCRIBE, TELEMETRY = "subscribeScene", "unsubscribeScene", "pushEngineTelemetry"
READY, COMPLETED, COLLISION, SHIP_COMPLETED, CARLA_ROUTE = (
    "isReady", "executionCompleted", "collision", "executionShipCompleted", "carlaSendLoc",
)  # fmt: skip

_FAILED = frozenset({"error", "failed", "timeout", "dispatched_without_ack", "rejected"})
"""Values of `status` that mean a failure, in the paper's system."""


class Profile(NamedTuple):
    """The names of the commands of one environment client."""

    reset: str
    observe: str
    act: str
    reset_ack: str
    observe_ack: str
    act_ack: str
    bodies: str
    """The field with the bodies of a fleet, in actions and observations; "" where there is one body alone."""


PROFILES: dict[str, Profile] = {
    "open_vocab": Profile(
        "resetScenario", "getObservation", "executeAction", "sceneResetAck", "observationResponse", "actionAck", ""
    ),
    "delivery": Profile(
        "resetDeliveryScenario", "getFleetObservation", "dispatchFleetAction",
        "sceneResetAck", "observationResponse", "actionAck", "drones",
    ),
    "fire_rescue": Profile(
        "resetFireRescueScenario", "getFireRescueObservation", "dispatchFireRescueAction",
        "fireRescueResetAck", "fireRescueObservationResponse", "fireRescueActionAck", "agents",
    ),
}  # fmt: skip
"""The profiles of the paper's engine client. A client answers the commands of its own profile alone."""

ProfileName = Literal["auto", "open_vocab", "delivery", "fire_rescue", "script"]
"""`auto`: the first profile that is acknowledged. `script`: long commands and events."""


def command_data(command: str, task_id: str, fields: Document, request_id: str) -> Document:
    """Return the frame of a command. With a request id, a reply is wanted."""
    ids = {"request_id": request_id, "requestId": request_id} if request_id else {}
    return {"type": "COMMAND", "data": {"commandType": command, "taskId": task_id, **ids, **fields}}


def request_id_of(message: Document) -> str:
    """Return the request id of a message in either spelling; "" without one."""
    for name in ("request_id", "requestId"):
        value = message.get(name)
        if isinstance(value, str) and value:
            return value
    return ""


def command_type(message: Document) -> str:
    """Return the `commandType` of a message; "" without one."""
    value = message.get("commandType")
    return value if isinstance(value, str) else ""


def result_of(message: Document) -> Document:
    """Return the result of a reply: `data`, else `payload`, else the whole message. A list counts by its first
    element."""
    for name in ("data", "payload"):
        value = message.get(name)
        if isinstance(value, list) and value:
            value = value[0]
        if isinstance(value, Mapping):
            return value
    return message


def failure_of(result: Document) -> str:
    """Return the failure that a result reports, in words; "" if it reports none."""
    error, status = result.get("error"), result.get("status")
    if error:
        return str(error)[:200]
    if isinstance(status, str) and status.lower() in _FAILED:
        reason = result.get("reason") or result.get("message") or ""
        return f"{status}: {reason}"[:200] if reason else status
    return ""


def task_of(message: Document) -> str:
    """Return the task id of a message, from itself or its data; "" without one."""
    for place in (message, message.get("data"), message.get("command")):
        if isinstance(place, Mapping):
            for name in ("taskId", "task_id"):
                value = place.get(name)
                if isinstance(value, str | int) and value != "":
                    return str(value)
    return ""
