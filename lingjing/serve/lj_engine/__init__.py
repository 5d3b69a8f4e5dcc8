"""LJ-ENGINE, the wire protocol between the paper's backend and its engines, both sides of it (ADR 0059).

Concepts are those of `lingjing.engines.remote`: session, link, exchange, driver. The *backend* is the server; engines
dial in. A *hosted* engine or world is ours and plays for a backend in another process.

Modules of the backend, in the order of control:

- `sessions`   one connection: its key, its frames that wait, its end
- `uploads`    pictures that come over HTTP
- `hub`        all sessions, the links of engines to them, the record of frames; `server`: the sockets
- `scenario`   the `resetScenario` object of an instance
- `photos`     a camera with pixels from a session
- `episodes`   waits for sessions and plays an episode

Modules of the engine's side:

- `client`     dials in, answers commands ← `answers`, `orders` (commands as verbs), `posting` (uploads)
- `hosted_engines`  the five methods for a backend of this project
- `hosted_world`    a world of our engines for a foreign backend

Invariants: one thread, that of the episode, decides; threads of connections read, write and queue. A hostile session
ends at most itself. Every frame is in the trace. `websockets` is imported by `server`, `sessions` and `client` alone.
"""
