"""The built-in engines, plug-ins like anybody's.

`builtin` declares them. Shared by them: `sea` (waves, wind, current), `plane` (bearings, polygons, land and water),
`clock` (fixed-step time),
`requests` (admission and receipts of pending commands). Then one package for each
kind of motion: `multirotor` (JSBSim), `vessel` (3-DOF), `city` (targets and their interactions), and `camera`.
"""
