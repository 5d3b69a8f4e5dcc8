"""A detector that was trained on exported frames, in place of the colour rules: no colour of a target is written here.

`targets` says at what scale each class of target is looked for; `weights/CLASS.npz` holds its network, as
`tools/train_detector.py` wrote it, and `weights/CARD.md` what it was trained on and how well it sees. `network`
computes in whole numbers; `detector` turns its answers into boxes and confidences.
In: a picture, its pose, the ground's elevation. Out: the boxes of one class, the surest first.
"""
