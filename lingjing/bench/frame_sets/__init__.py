"""Labelled sets of frames for detectors, and the paper's probe of how they bear another appearance.

`sources` names traces, or has development episodes played → `labelled` reads frames with their true boxes out of them →
`balance` chooses as many with a target as without, hard ones first, and splits them by seed → `folder` writes the set
as COCO and as a Hugging Face image folder, with a `card`, and reads it back.
`twins` takes in edited pictures of a set's frames; `probe` asks detectors whether frames and twins show a target, and
makes the table of F1.
In: traces, pictures that others edited; out: folders that are there whole or not at all, counts, a table.
"""
