"""`react`: perceive, reason, act over a chat model.

`prompt` (brief → system prompt, observation → text) and `picture` (pixels → JPEG) make the request; `schema` says
what an answer must look like; `step` reads and checks it on our side; `policy` runs the loop: ask, check, repair at
most a few times, account tokens and cost, give up with a reason before the kernel's barrier does.
"""
