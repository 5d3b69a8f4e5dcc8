"""Two agent scaffolds beside `react`, written as a plug-in of another package would be.

They build on the parts of `react` through `lingjing.plugins.scaffold`. They import nothing of this distribution, which
an import contract checks. `docs/scaffolds.md` explains them.

- `plan_manage_act`    a planner, a manager and the actor: up to three requests at a boundary
- `reflective_memory`  a lesson from each failed command, shown at every later boundary
- `json_objects`       the reading of JSON objects in the answers of models
"""
