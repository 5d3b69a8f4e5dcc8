"""Episodes run again from their traces: what nobody saw is drawn, what did not happen is tried.

`lookback` draws pictures that no agent asked for, from the states that a trace holds.
"""
