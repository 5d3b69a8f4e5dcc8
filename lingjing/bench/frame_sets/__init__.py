"""Labelled sets of frames for detectors.

`sources` names traces, or has development episodes played → `labelled` reads frames with their true boxes out of them →
`balance` chooses as many with a target as without, hard ones first, and splits them by seed → `folder` writes the set
as COCO and as a Hugging Face image folder, with a `card`, and reads it back.
In: traces; out: a folder that is there whole or not at all, and a function of its frames.
"""
