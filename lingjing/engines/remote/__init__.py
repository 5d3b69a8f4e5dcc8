"""Engines that run in another program and are reached over LJ-ENGINE, the wire protocol of the paper's engines (ADR
0059). `docs/remote-engines.md` is the page for users.

Concepts. A *session* is the connection of a foreign engine; its key is `LJ-ENGINE_airsim`. A *link* carries the frames
of one engine of ours and its session. An *exchange* is one call over a link: it sends requests, waits for their replies
until a deadline, and returns the events that arrived before. A *driver* translates between the five methods of an
engine and exchanges. There are three, and the first acknowledgement decides:

- *exact*: the session is a process of this project. Boundaries and receipts travel unchanged in fields `lingjing`.
- *offsets*: an environment client. Each tick sends an offset for each body and asks for poses.
- *script*: a simulator that carries out long commands and reports their ends as events.

Modules in the order of control:

- `link`       requests, exchanges, and the link of a recorded trace
- `messages`   names and forms of messages: profiles, results, failures
- `poses`      coordinates of messages ↔ the world's, states from poses
- `exact`, `offsets`, `script`   the drivers
- `engine`     `RemoteEngine`, an engine with the five methods; `unconnected`: the engine `remote` without a server
- `recorded`   the remote engines of a trace, for its replay

In: commands and the frames of a session. Out: boundaries. Invariants: a driver reads no clock and nothing but
exchanges, so an episode is repeated from its recorded frames. The sockets are in `lingjing.serve.lj_engine`.
"""
