"""The processes of policies: one for each agent, so that a policy can ruin nothing but itself.

`barrier` asks the policies of an episode (`ProcessBarrier`, in the place of `kernel.barrier.PolicyBarrier`) ← `turns`
waits for several processes, each with its deadline ← `agent_process` is one of them as the player sees it ← `output`
passes on what it prints, `model_calls` answers for the record of its model calls. `host` is the far end, which a fork
server calls. What crosses the border: `messages`, as memory (`letters`); `observations` and their `pictures`.
`loading` makes the requests that load an episode's policies, `preloading` imports what a team needs before the fork,
and `examination` has processes read the declarations of policies in files (`declaring` is their far end).

In: briefs, observations, inboxes. Out: decisions, or the reason why there is none. Nothing that comes from a policy's
process is trusted, and nothing that it does is waited for longer than its deadline. `lingjing run` and `bench` play so;
`lingjing.run`, `--world inline`, the environments and branches have the policies in their own process.
"""
