"""`faulty-oracle` and `faulty-heuristic`: a policy in which a known fault is planted.

`options` says which faults there are: who, in which faculty, from which boundary on. `policy` wraps another policy and
lets each fault change what that is shown or what it answers: `shown` (what its pictures show, where it believes they
were taken) and `answered` (where it says things are, where it sends bodies, what it says to others, what it does).
Before a fault begins the answers are those of the wrapped policy, so an episode can be compared with the one without.
"""
