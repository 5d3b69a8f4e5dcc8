"""`react`: perceive, reason, act over a chat model: the paper's agent.

In the order of a call: `options` (what it is played with; `prompt_files`, `prompts` its prompt) → `ablation`,
`route_guidance` (what is shown; the interventions A0 to A3), `facts` (brief → what may be commanded and said, what is
known), `road_costs`, `state` (observation and inbox → one line of JSON), `pictures` (pixels → JPEG, whole, in tiles or
cut out, and what is known of each), `history` (earlier turns, bounded) make the request; `answer` finds the step in
what comes back and `step` checks it against the schema of `lingjing.plugins.decisions` and reads commitments and plan;
`search_budget` bounds how often cells are searched again. `policy` runs the loop: ask, show what is to be seen closer,
repair, account tokens and cost, give up with a reason (`remedy` says what to do) before the kernel's barrier does.
`prompt_reviser` has a second model revise a prompt from failed traces.

Invariants: a request holds what the brief, the observation and the inbox hold and nothing else; numbers are those that
the kernel enforces; earlier turns stay as they were sent, so that services can keep the beginning of a request.
"""
