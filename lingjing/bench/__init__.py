"""Many episodes: matched seeds over missions, modes and policies.

`columns` are missions in their modes and at the values of their sweeps → `study` plays each with the same seeds, goes
on where it was stopped and prints the table → `countdown` says how long the rest takes.
"""
