"""The processes of policies, one for each agent: a policy can damage only its own process.

The *player* is the process of the episode. It sends briefs, observations and inboxes, and receives decisions, or the
reason for which there is none. It trusts nothing that a policy's process sends, and waits for nothing beyond a
deadline. `lingjing run` and `bench` play in this way. `lingjing.run`, `--world inline`, the environments and branches
have the policies in their own process.

In the order of a call:

- `loading`        the requests that load an episode's policies; `preloading` prepares modules and plug-ins
  before the fork
- `barrier`        `ProcessBarrier`, in the place of `kernel.barrier.PolicyBarrier` ← `turns`, the waiting for several
  processes with a deadline each
- `agent_process`  one process from the player's side ← `output`, its printed text; `model_calls`, the record of its
  calls
- `servers`        the servers that start these processes: without walls, or with walls around each; `broker` makes the
  model calls of an agent behind walls
- `host`           the policy's side, called by a fork server
- `messages`       the requests and answers; `observations` and `pictures` convert an observation
- `examination`    the declarations of policies in files ← `declaring`, the other side
"""
