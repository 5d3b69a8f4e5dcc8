"""`resetScenario` documents in and out: another text form of a mission, which fills a template.

Concepts. A document places entities and hides targets. A *template* is a compiled mission that supplies everything
else. A *hidden field* holds hidden places. A *frame* converts the document's coordinates to metres.

Modules in control-flow order: `shapes` (the parts of a document as pydantic models), `spelling` (alternative keys),
`elements` (orbital elements of satellites), `faults` (errors in words), `repair` (repairs a document with errors, so
that one run reports all of them), `document` (a parsed document), `fields` (hidden fields), `row_goals` (goals of
single UAVs), `template` (selects the template), `unit` and `frame` (unit and position of its coordinates), `groups` and
`targets` (fill groups of the template), `scene_fit` (moves and widens the scene), `notes` (unread parts and repeated
start positions), `reading` (a document → a mission), `emit` (a mission → a document), `schema` (the JSON Schema).

Within `lingjing.mission` only this package uses pydantic. It is loaded for `resetScenario` documents alone.
"""
