"""Processes: how they are started, forked, supervised and ended, and the channel between two of them.

Lingjing plays with many processes: engines and cameras, the policy of each agent, the episodes of a suite, the branches
of a trace. This package holds what they have in common and knows nothing of what they do. Only here stand `os.fork`,
prctl(2) and the framing of messages. The concepts:

- A *channel* carries packets of bytes with file descriptors between two processes. What the bytes mean is declared
  beside the processes that speak (`kernel.world.messages`, `play.policy_processes.messages`, `causal.branch_process`).
- A *deadline* is counted in the other process's own time: a busy machine does not shorten it.
- A *fork server* is a process of one thread that has imported everything. A command starts one and asks it for
  processes: a fork is ready in milliseconds, an interpreter that imports the engines in seconds.
- An *owner* is the process that another one works for and ends with. No process outlives the command that started it,
  even if it leaves its session or its parent: the server adopts such orphans and ends them.

In the order of a call:

- `fork_client`      `ForkServer` and `ForkServerClient`, the ends of a fork server, and `ForkedProcess`
- `fork_requests`    the requests that it takes
- `fork_server`      `python -m lingjing.processes.fork_server` ← `forks` (the processes that it has forked), `becoming`
  (the first steps of a fork), `idle_processes` (processes that are reused), `templates` (forks that have made something
  ready), `layers` (forks that have imported more)
- `channel`, `deadlines`, `output`   packets, limits of time, and the output of a process
- `signals`          signals that are blocked, deferred or ignored, and the end at the second interrupt
- `descendants`      the processes below this one ← `linux`, the system calls

Linux only, but for `deadlines` and `signals`.
"""
