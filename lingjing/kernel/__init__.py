"""The lockstep kernel: Algorithm 1 of the paper and its operational expansion, line by line.

In the order control flows:

- `staging` builds the city of an instance and puts everything where it belongs there;
- `barrier` calls every policy in a thread of its own and collects by name within K_model;
- `bus` validates and expands messages (ValidateAndExpand, Stage, Commit, DeliveredTo), as far as the `air` carries;
- `candidates` makes plain values of what policies returned;
- `commands` validates and resolves physical commands (ValidateAndResolve);
- `world` hosts and couples the engines (`contract` is all the kernel knows of it);
- `assignments` reads destinations out of commands and messages;
- `budgets` counts what commands and messages use up, `inspections` follows routes waypoint by waypoint;
- `registry` is G, the shared state: an immutable value that `Update` replaces; `course` is the part of it that budgets,
  inspections and stages keep, `ledger` a mapping in it that only grows;
- `happenings` are the mission's own events (weather, who comes and goes) at their boundaries;
- `pictures` turns captures into what is stored and what policies receive;
- `stocks` finds a declared state among an engine's resources (`p.demand`);
- `visibility` projects what an agent may see (ProjectVisible) and may know (the brief); `announcements` decides which
  events are told to whom, `references` the pictures shown at the start;
- `instant` is one moment, `facts` what only a running mission answers, `rules` the evaluation of expressions,
  `adjudication` latches them as events (Adjudicate), `constraints` what must hold all along, `stages` their times;
- `subtasks` counts the parts of success;
- `evaluation` scores and ends the episode (Evaluate, TerminationReason);
- `recording` derives records from what was published;
- `playable` refuses what a mission may say and the kernel does not play yet;
- `step` is W.Step, `episode` the loop around it.

In: an `Instance`, a `City`, a `World`, policies. Out: boundary records and an `Outcome`. Invariants: nothing that
decides an outcome reads a wall clock, a global random stream or the order of a set; every kernel state is a value, so a
fork copies it; hidden state reaches policies only through `visibility`, which never looks at it.
"""
