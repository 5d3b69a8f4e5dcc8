"""Everything a plug-in author needs: contracts, values, hooks, geometry and the conformance kit.

`hookspecs` (what a plug-in may offer) → `host` (finds it) → `engine`, `policy` (the Protocols and their values) →
`geometry` (camera rays and headings) → `conformance` (tests for engines and policies) → `engines/` (the built-in
ones). Nothing here knows the kernel.
"""
