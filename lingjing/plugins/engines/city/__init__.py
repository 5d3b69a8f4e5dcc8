"""The city engine: targets as they are without anybody's help, and what the mission allows to be done to them.

`engine` (the contract) → `afloat` (drifting and bobbing) and `interaction` (unlocked by the kernel, performed here
when the right actor is close enough). Nothing here knows what a mission calls its targets.
"""
