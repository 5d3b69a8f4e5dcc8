"""`resetScenario` documents in and out: another spelling of a mission, which instantiates a template.

In the order of the work: `shapes` (what is read, as pydantic models), `spelling` (keys under one name), `elements` (a
satellite's), `faults` (in words), `repair` (so that one run tells all of them), `document` (a document that was read),
`fields` (hidden places), `row_goals` (goals of one UAV each), `template` (which mission it is for), `unit` and `frame`
(its lengths, where it lies), `groups` and `targets` (what is placed where), `scene_fit` (the scene comes to it),
`starts` (places that the initial state repeats), `notes` (what is left over), `reading` (a document → a mission),
`emit` (the way back), `schema` (the JSON Schema).

This package is the one door to pydantic in `lingjing.mission`; it is loaded for `resetScenario` documents alone.
"""
