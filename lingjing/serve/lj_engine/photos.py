"""Pictures of a foreign engine: our camera for the geometry, the session `image` for the pixels.

The boxes are those of our own camera at the pose that the owner of the body has reported, unless the upload has a field
`boxes`. Then they are the engine's.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.engines.remote.messages import command_data
from lingjing.engines.remote.poses import engine_of
from lingjing.mission.instance import CameraSpec, Entity, Instance
from lingjing.plugins.engine import Boundary, CaptureRequest, Command, Engine, EngineSpec, Frame, Receipt
from lingjing.scene.city import City
from lingjing.serve.lj_engine.hub import Hub
from lingjing.serve.lj_engine.sessions import Session
from lingjing.serve.lj_engine.uploads import Upload
from lingjing.trace.records import BodyState, Box

_VIEWS = {"nadir": "topdown", "front": "front", "oblique": "global"}
"""The view types of the protocol, by those of cameras."""
_NAMES = {"multirotor": "droneId", "plane": "droneId", "road": "carId", "quadruped": "dogId"}
_MOST_BOXES = 1000


class RemoteCamera:
    """A sensor engine that asks a session for the pixels."""

    def __init__(self, camera: Engine, hub: Hub, key: str, url: Callable[[Session], str], deadline_s: float) -> None:
        """`camera` gives poses, boxes and depth; `key` names the session, `url` is the address for its uploads."""
        self._camera, self._hub, self._key, self._url = camera, hub, key, url
        self._deadline_s = deadline_s
        self._instance: Instance | None = None

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Reset our own camera."""
        self._instance = spec.instance
        return self._camera.reset(spec, city, seed)

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Pass commands on."""
        return self._camera.submit(commands)

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Move all bodies in our own camera."""
        return self._camera.advance(until, mirrors)

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """Return the pictures with pixels that came in time. Reference pictures are drawn here."""
        answers = []
        for frame, request in zip(self._camera.capture(requests), requests, strict=True):
            if request.pose is not None:
                answers.append(frame)
                continue
            upload = self._photograph(request)
            if upload is not None:
                answers.append(self._with_pixels(frame, upload))
        return tuple(answers)

    def close(self) -> None:
        """Close our own camera."""
        self._camera.close()

    def _photograph(self, request: CaptureRequest) -> Upload | None:
        """Ask the session for a picture; None if it is not connected or late."""
        session = self._hub.sessions.get(self._key)
        if session is None or session.lost or self._instance is None:
            return None
        entity = next(each for each in self._instance.entities if each.id == request.entity)
        photo = self._hub.pictures.expect(request.frame)
        fields = {"modelIdList": [self._wish(entity, request, photo, self._url(session))]}
        frame = msgspec.json.encode(command_data("takePhoto", self._hub.task_id, fields, ""))
        self._hub.send(session, frame)
        return self._hub.pictures.take(photo, self._deadline_s)

    def _wish(self, entity: Entity, request: CaptureRequest, photo: str, url: str) -> dict[str, Any]:
        mount: CameraSpec = next(each for each in entity.cameras if each.name == request.camera)
        name = _NAMES.get(engine_of(entity), "droneId")
        wish: dict[str, Any] = {"droneId": "", "carId": "", "dogId": "", name: entity.label or entity.id}
        view = _VIEWS[mount.view]
        form = {
            "taskId": self._hub.task_id, "taskType": self._instance.mission if self._instance else "",
            "agentId": entity.label or entity.id, "agentType": entity.type, "viewType": view,
            "analysisType": "", "stepIndex": str(request.tick), "photoid": photo, "subtaskIndex": "0",
        }  # fmt: skip
        upload = {
            "url": url, "method": "POST", "contentType": "multipart/form-data", "fileField": "file",
            "fields": form,
        }  # fmt: skip
        return {**wish, "viewType": view, "photoid": photo, "uploadSpec": upload}

    def _with_pixels(self, frame: Frame, upload: Upload) -> Frame:
        boxes = _boxes(upload, self._instance, frame)
        info = msgspec.structs.replace(
            frame.info, boxes=frame.info.boxes if boxes is None else boxes, renderer=f"{self._key} over LJ-ENGINE"
        )
        height, width = frame.rgb.shape[:2]
        return replace(frame, info=info, rgb=_resized(upload.rgb, width, height))


def _resized(rgb: npt.NDArray[np.uint8], width: int, height: int) -> npt.NDArray[np.uint8]:
    """Return a picture in the size of the camera."""
    if rgb.shape[:2] == (height, width):
        return rgb
    import PIL.Image

    return np.array(PIL.Image.fromarray(rgb).resize((width, height), PIL.Image.Resampling.LANCZOS))


def _boxes(upload: Upload, instance: Instance | None, frame: Frame) -> tuple[Box, ...] | None:
    """Return the boxes that an engine has sent; None without valid ones. Boxes of unknown bodies are left out."""
    text = upload.fields.get("boxes")
    if text is None or instance is None:
        return None
    try:
        rows = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(rows, list):
        return None
    entities = {name: entity for entity in instance.entities for name in (entity.id, entity.label) if name}
    height, width = frame.rgb.shape[:2]
    boxes = []
    for row in rows[:_MOST_BOXES]:
        entity = entities.get(str(row.get("id", ""))) if isinstance(row, dict) else None
        corners = row.get("box") if isinstance(row, dict) else None
        if entity is None or not isinstance(corners, list) or len(corners) != 4:
            continue
        try:
            left, top, right, bottom = (min(max(float(corner), 0.0), 1.0) for corner in corners)
        except (TypeError, ValueError, OverflowError):
            continue
        if left < right and top < bottom:
            pixels = round((right - left) * width * (bottom - top) * height)
            boxes.append(Box(entity=entity.id, cls=entity.type, box=(left, top, right, bottom), pixels=pixels))
    return tuple(boxes)
