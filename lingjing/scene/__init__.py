"""Scene providers: what a mission names after `scene` → one `City` that every engine shares.

`city` (the values) ← `bay` (a procedural sea bay: a harbour point with an apron, beach, rocks and a pier in open
water, a coast around it, and things afloat). A provider's `build` is a pure function of its `SceneSpec`: the same
spec gives an equal city in every process. Nothing here draws, moves or imports a plug-in.
"""
