"""Rules of flying agents that guide a walker which cannot see its destination, by `guidance` messages.

- `to_leak`: finds a leak, reports it, then sends one step at a time
- `to_building`: guides to the building of a reference picture with a whole path at once
"""
