"""What holds for every test: hypotheses are tried with the same examples everywhere and without a clock, for what a
loaded machine takes longer for is not wrong; and signals are heard, even in tests that a shell runs in its background
or under `nohup`, where its children ignore them. Numerical libraries are pinned before anything loads them."""

from __future__ import annotations

import signal

from hypothesis import settings

from lingjing.numerics import pin

pin()  # as the command line does, before anything loads numpy

for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, usual)

settings.register_profile("lingjing", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("lingjing")
