"""Labelled sets of frames for detectors, and the paper's probe of detectors on pictures of another appearance.

A *frame set* holds, for each class of targets, frames with and without a target, split by seed. A *twin* is an edited
picture of a frame, with the same entities at the same places. A *probe* compares detectors on frames and twins.

- `sources`   finds traces, or plays development episodes
- `labelled`  frames of a trace with their true boxes
- `balance`   chooses as many frames with a target as without, hard ones first, and splits them by seed
- `folder`    writes a set as COCO and as a Hugging Face image folder with a card, and reads it
- `twins`     imports edited pictures of a set
- `probe`     runs detectors on frames and twins, and makes the table of F1

Folders are written completely or not at all.
"""
