"""The city engine: targets as they are without anybody's help, what a mission allows to be done to them, and the radio.

`engine` (the contract) → `target` (one target's state) ← `nature` (burning, leaking, waiting: told from properties),
`whereabouts` (where it is, drifting and bobbing), `arrivals` (queues that grow and shrink), `interaction` (unlocked by
the kernel, performed here when the right actor is close enough for long enough); `goods` (who has how much of what) and
`radio` (who does not hear whom). Nothing here knows what a mission calls its targets.
"""
