"""The detectors of frames: rules, and a chat model over real HTTP."""

from __future__ import annotations

import base64

import numpy as np
import pytest
from lingjing_agents.frame_detectors import colour_detector, model_detector, question_of

from agents.tests.agent_kit import NADIR
from agents.tests.chat_server import Reply, serve
from lingjing.errors import UsageError
from lingjing.plugins.frame_detector import FrameQuestion
from lingjing.plugins.geometry import camera_pose
from lingjing.testing import decode_jpeg, encode_jpeg

POSE = camera_pose((0.0, 0.0, 96.5), 0.0, NADIR)
SEA = np.full((1080, 1920, 3), (36, 76, 90), np.uint8)
QUESTION = FrameQuestion("person_in_water", encode_jpeg(SEA), SEA, POSE, -3.5)


def test_the_rules_detect_nothing_on_open_water_and_accept_no_option() -> None:
    answer = colour_detector({}).answer(QUESTION)
    assert (answer.present, answer.boxes, answer.failure) == (False, (), "")
    with pytest.raises(UsageError, match="size"):
        colour_detector({"size": "3"})


@pytest.mark.parametrize(
    ("reply", "present", "failed"),
    [
        ({"present": True}, True, False),
        ('<think>{"present": true} or not?</think> ```json\n{"present": false}\n```', False, False),
        ("Yes, I see one.", False, True),
        ({"present": "yes"}, False, True),
    ],
)
def test_a_model_answers_yes_or_no_and_anything_else_is_a_failure(reply: object, present: bool, failed: bool) -> None:
    with serve([Reply(reply)]) as server:
        answer = model_detector({"model": "eye", "base_url": server.url}).answer(QUESTION)
    assert (answer.present, bool(answer.failure)) == (present, failed)
    (request,) = server.requests
    text, shown = request["messages"][-1]["content"]
    assert text["text"] == question_of("person_in_water")
    sent = base64.b64decode(shown["image_url"]["url"].partition(",")[2])
    assert sent == QUESTION.jpeg


def test_a_png_picture_is_sent_as_jpeg() -> None:
    import io

    import PIL.Image

    out = io.BytesIO()
    PIL.Image.fromarray(SEA).save(out, "PNG")
    with serve([Reply({"present": False})]) as server:
        model_detector({"model": "eye", "base_url": server.url}).answer(
            FrameQuestion("person_in_water", out.getvalue(), SEA, POSE, -3.5)
        )
    url = server.requests[0]["messages"][-1]["content"][1]["image_url"]["url"]
    assert np.abs(decode_jpeg(base64.b64decode(url.partition(",")[2])).astype(int) - SEA).max() <= 3


def test_an_error_of_the_service_is_a_failure_and_not_an_answer() -> None:
    with serve([Reply(status=400, body="no pictures here")]) as server:
        answer = model_detector({"model": "eye", "base_url": server.url}).answer(QUESTION)
    assert not answer.present
    assert "no pictures here" in answer.failure
