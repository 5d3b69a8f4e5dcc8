"""The plug-ins that are installed beside this project: found, and tried before they are loaded.

A plug-in is an entry point of an installed distribution. Its metadata may be broken, and its module may raise, end the
process or never return; none of that may stop an episode that does not use it.

- `entry_points`  the entry points of all distributions, each read for itself
- `discovery`     the plug-ins that can be loaded, the faults of the rest ← `probe`, the process in which one is tried

`lingjing.plugins.host` loads what came through. Only `probe`, which asks the host, knows what a plug-in offers.
"""
