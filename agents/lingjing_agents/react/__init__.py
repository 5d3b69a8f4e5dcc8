"""`react`: perceive, reason, act over a chat model.

`prompt` (brief → system prompt, observation → text) and `picture` (pixels → JPEG) make the request; `schema` says
what an answer must look like; `answer` finds the step in it, `step` reads and checks it on our side; `policy` runs the
loop that `arguments` describes: ask, check, repair at most a few times, account tokens and cost, give up with a reason
(`remedy` says what to do) before the kernel's barrier does.
"""
