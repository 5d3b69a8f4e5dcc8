"""The processes of a command: how they start, fork and end, and the channel between two of them.

Lingjing uses many processes: engines and cameras, the policy of each agent, the episodes of a suite, the branches of a
trace. This package holds their common part and depends on none of them. Only this package calls `os.fork` and prctl(2)
and frames messages. The concepts:

- A *channel* carries packets of bytes with file descriptors between two processes. The packages of the two processes
  declare the meaning of the bytes (`kernel.world.messages`, `play.policy_processes.messages`, `causal.branch_process`).
- A *deadline* is counted in the other process's own time: a busy machine does not shorten it.
- A *fork server* is a process of one thread that has imported all modules. A command starts one and requests processes
  from it: a fork is ready in milliseconds, an interpreter that imports the engines in seconds.
- The *owner* of a process is the process that it works for; it ends with its owner. No process outlives the command
  that started it, even if it leaves its session or its parent: the server adopts such orphans and ends them.

In the order of a call:

- `fork_client`      `ForkServer` and `ForkServerClient`, the ends of a fork server, and `ForkedProcess`
- `fork_requests`    the requests to a fork server
- `fork_server`      `python -m lingjing.processes.fork_server` ← `forks` (its forked processes), `becoming` (the first
  steps of a fork), `idle_processes` (processes that are used again), `templates` (forks that hold a prepared object),
  `layers` (forks that have imported more modules), `kept_results` (results for later forks)
- `channel`, `deadlines`, `output`   packets, limits of time, and the output of a process
- `walls`            walls around a process with foreign code (ADR 0057)
- `signals`          signals that are blocked, deferred or ignored, and the end at the second interrupt
- `descendants`      the processes below this one ← `linux`, the system calls

Linux only, except `deadlines` and `signals`.
"""
