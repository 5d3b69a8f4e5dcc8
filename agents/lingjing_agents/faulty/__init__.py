"""`faulty-oracle` and `faulty-heuristic`: policies with planted faults, to measure methods that find faults.

`options` declares the faults: agent, faculty and first boundary of each. `policy` wraps another policy and applies each
fault to its observations (targets in pictures) or to its decisions (reported positions, destinations, messages,
commands). Before a fault begins, decisions equal those of the wrapped policy, so an episode can be compared with the
one without faults.
"""
