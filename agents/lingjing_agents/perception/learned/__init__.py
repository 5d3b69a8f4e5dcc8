"""Detectors that are trained on exported frames, in place of the colour rules. No colour of a target is written here.

`targets` declares the scale at which each class is searched for. `weights/CLASS.npz` holds its network as written by
`tools/train_detector.py`, and `weights/CARD.md` the training data and accuracy. `network` computes in whole numbers;
`detector` converts its output into boxes and confidences.

In: a picture, its pose, the ground's elevation. Out: the boxes of one class, highest confidence first.
"""
