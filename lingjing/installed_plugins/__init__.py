"""The discovery of installed plug-ins, with a trial of each before it is loaded.

A plug-in is an entry point of an installed distribution. Its metadata may be broken. Its module may raise, end the
process or never return. None of that may stop an episode that does not use the plug-in. So each plug-in of another
party is first loaded in a process of its own (a *trial*); a plug-in that fails its trial is a *fault* and is left out.

- `entry_points`  the entry points of all distributions, each read for itself
- `discovery`     the plug-ins that can be loaded, the faults of the rest ← `probe`, the process of one trial;
  `slow_trials`, the faults that are remembered

`lingjing.plugins.host` loads the plug-ins that passed. Only `probe`, which uses the host, calls hooks.
"""
