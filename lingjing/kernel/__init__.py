"""The lockstep kernel: the paper's Algorithm 1 and its operational expansion, Algorithm 2.

Concepts. An episode is a sequence of decision ticks. Between two ticks lies a *boundary*, the state at which all
engines and agents are synchronised. At each boundary every policy receives an observation and returns a decision: at
most one command and some messages. The kernel validates them and answers each with a *receipt*. It then advances the
engines to the next boundary in *macro-steps*, adjudicates the mission's rules, and publishes the next observations.
Rules that become true produce *adjudicated events*; engines report *task events*.

Modules in the order of control:

- `cities` builds the city of an instance and places its entities in it; `supported` rejects instances with features
  that the kernel does not implement;
- `barrier` calls every policy in a thread of its own within K_model seconds (`play.policy_processes` does so in
  processes); `sequential` does so without threads, in a process that will be forked; `ambient_random` detects the use
  of global random generators in policies;
- `candidates` copies decisions into plain values; `admission` compiles the checks of command arguments and message
  bodies;
- `bus` validates and expands messages (ValidateAndExpand, Stage, Commit, DeliveredTo) over the links between agents,
  which `changing_radio` makes worse where events say so;
- `commands` validates and resolves physical commands (ValidateAndResolve) within `command_limits`; `budgets` counts
  what commands and messages consume;
- `world` hosts and couples the engines; the kernel depends on `world.contract` alone;
- `registry` is G, the shared state: an immutable value that `registry_update` replaces at each boundary (Update);
  `progress` is its part for budgets, inspections, stages and constraints; `append_only` is the mapping for its growing
  parts;
- `claims` limits the positive claims that rules see;
- `assignments` reads destinations from commands and messages; `inspections` follows routes waypoint by waypoint;
- `gnss` gives the errors of satellite navigation receivers, `imu` the readings of inertial units;
- `mission_events` lets the mission's own events occur and undoes them (weather, presence, states of targets);
- `pictures` decides which pictures are taken and what policies receive of them, reference pictures included;
  `swapped_pictures` takes those of another instance in their place;
- `stocks` reads declared states from engine resources (`p.demand`);
- `visibility` projects observations (ProjectVisible) and builds briefs; `event_visibility` selects the events of an
  observation; `rule_sentences` words the mission's rules;
- `context` is the environment in which expressions are evaluated, `facts` the functions that need a running mission,
  `rules` the evaluator of expressions; `temporal` updates the past of conditions over time, a `memory` for each;
- `adjudication` latches rules as events (Adjudicate); `constraints` checks invariants; `stages` times the stages;
- `subtasks` counts the parts of success; `evaluation` computes score and termination (Evaluate, TerminationReason);
  `evaluators` builds evaluators of plug-ins and checks their results;
- `recording` derives trace records from published values;
- `step` is W.Step; `episode` is the loop around it.

In: an `Instance`, a `City`, a `World`, policies. Out: boundary records and an `Outcome`.

Invariants: nothing that decides an outcome reads a wall clock, a global random stream or the order of a set. Every
kernel state is a value, so a fork copies it. Hidden state reaches policies only through `visibility`, which never reads
it.
"""
