"""`react`: perceive, reason, act over a chat model.

`prompt` (brief → system prompt, observation → text) and `picture` (pixels → JPEG) make the request; `answer` finds the
step in what comes back and checks it against the schema of `lingjing.plugins.decisions`; `policy` runs the loop that
`options` describes: ask, check, repair at most a few times, account tokens and cost, give up with a reason (`remedy`
says what to do) before the kernel's barrier does.
"""
