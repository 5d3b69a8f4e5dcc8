"""The lockstep kernel: Algorithm 1 of the paper and its operational expansion, line by line.

In the order of control:

- `cities` builds the city of an instance and places its entities there; `supported` refuses what cannot be played;
- `barrier` calls every policy, each in a thread of its own unless it is elsewhere (`play.policy_processes`), and
  collects their answers by name within K_model; `sequential` does so without threads, in a process that is going to be
  forked; `ambient_random` detects the use of global random generators there;
- `candidates` turns what policies returned into plain values; `admission` compiles the checks of arguments and bodies;
- `bus` validates and expands messages (ValidateAndExpand, Stage, Commit, DeliveredTo) over the `links` between agents;
- `commands` validates and resolves physical commands (ValidateAndResolve) within their `command_limits`; `budgets`
  counts what both use up;
- `world` hosts and couples the engines (`contract` is all that the kernel knows of it);
- `registry` is G, the shared state: an immutable value, which `registry_update` replaces (Update); `progress` is the
  part of it that budgets, inspections, stages and constraints keep; `append_only` is the mapping that its growing parts
  are made of;
- `assignments` reads destinations from commands and messages; `inspections` follows routes waypoint by waypoint;
- `scheduled` are the mission's own events (weather, entities that come and go) at their boundaries;
- `pictures` decides which pictures are taken and what policies receive of them; `reference_pictures` are those shown at
  the start;
- `stocks` reads declared states from an engine's resources (`p.demand`);
- `visibility` projects what an agent may see (ProjectVisible) and may know (the brief); `event_visibility` decides
  which events are told to whom, `rule_sentences` says what the rules are;
- `context` is what expressions are evaluated on, `facts` the functions that only a running mission answers, `rules`
  the evaluation of expressions;
- `adjudication` latches rules as events (Adjudicate), `constraints` checks what must always hold, `stages` times
  the stages;
- `subtasks` counts the parts of success; `evaluation` scores and ends the episode (Evaluate, TerminationReason),
  `evaluators` builds those of plug-ins and checks what they answer;
- `recording` derives records from what was published;
- `step` is W.Step, `episode` the loop around it.

In: an `Instance`, a `City`, a `World`, policies. Out: boundary records and an `Outcome`. Invariants: nothing that
decides an outcome reads a wall clock, a global random stream or the order of a set; every kernel state is a value, so a
fork copies it; hidden state reaches policies only through `visibility`, which never looks at it.
"""
