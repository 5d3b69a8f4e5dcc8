"""`react`: the policy that perceives, reasons and acts over a chat model: the agent of the paper.

At each boundary the policy sends one request: a system text, earlier turns, the state as JSON, and pictures. It reads
one step from the answer: a decision, lines to keep, or a part of a picture to see enlarged. Four replaceable parts
write and read these texts (`lingjing.plugins.scaffold`); this package holds the default parts and the loop.

In control-flow order:

- `options`        the options; `prompt_files` and `prompts` hold the prompts
- `ablation`, `route_guidance`   remove or add parts of the observation (the paper's ablations, interventions A0 to A3)
- `prompt`         the prompt builder: `facts` (the brief in words), `road_costs`, `state` (a boundary as JSON)
- `pictures`       JPEG files of pictures: whole, in tiles, or cut out; `standing`: what stands in one from above
- `request_budget` the tokens of a request, counted by `token_bound`, and the room that is left for earlier turns
- `history`        the memory: earlier turns as differences (`state_difference`), and the lines that the model keeps
- `answer`, `step` the parser: the step in an answer, checked with the schema of `lingjing.plugins.decisions`
- `own_counts`     the agent's commands and claims so far
- `search_budget`  the bound on repeated searches of a cell
- `policy`         the loop: request, crops, repairs, bill; it ends with a reason (`remedy`) before the kernel's limit
- `call_profile`   the calls and tokens of an episode from a measured one, for estimates of suites
- `brokering`      the model calls of a policy behind walls, on the side of the harness
- `prompt_reviser` a second model that revises a prompt from failed traces

Invariants: a request holds the content of the brief, the observation and the inbox and nothing else; numbers are those
that the kernel enforces; earlier turns stay as they were sent, so that services can cache the beginning of a request.
"""
