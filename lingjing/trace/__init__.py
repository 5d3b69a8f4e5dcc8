"""The trace: one MCAP file per episode, from which everything after the episode is computed.

In the order in which an episode meets them:

- `records`    the vocabulary: what engines, agents and the kernel say to each other, and what is kept of it
- `request_ids` what requests are called: commands, messages, the kernel's own
- `images`     pictures as bytes and back; policies receive what is stored
- `encoding`   records as JSON, the same bytes for the same record
- `digest`     what two runs are compared by: the chain over boundaries, the one over pictures, the digest of one policy
               input; `verify`: whether records agree
- `digest_form` which fields of a boundary a digest covers, under frozen names, in each version of the digest
- `schemas`    JSON Schemas of the records, generated; `python -m lingjing.trace.schemas` writes them
- `topics`     the names of the file's topics
- `admitted`   what agents said at a boundary and the bus admitted
- `surroundings` the city and where cameras are mounted, as whoever writes a trace tells it for viewers
- `foxglove`   the same boundary in Foxglove's published schemas: poses, scene, images, logs, geo positions;
  `foxglove_city` the city; `wire` messages put together from encoded parts
- `shown`      which of these messages an episode has, and when: what viewers are shown
- `seals`      the hash chain over the file's bytes, and its signature
- `container`  the MCAP file itself; it, `chunks` and `seal_difference` alone import `mcap`
- `chunks`     one chunk of it, unpacked within bounds
- `writer`     `TraceWriter`: header, boundaries, outcome
- `signals`    signals wait while a boundary is written
- `calls`      what is kept of questions to chat models; `call_store` the SQLite file beside the trace that holds them
- `reader`     `read_trace`: the records back, pictures on demand
- `copying`    a trace under another header, its pictures byte for byte
- `following` `TraceFollower`: a trace that is still written, read as it grows
- `seal_difference` which record is not as it was sealed
- `seal_check` the bytes against the seals
- `verification` `verify_file`: bytes and records, one answer

Invariants: a file named `.part` is unfinished, and reads to its last complete boundary wherever it was cut; the two
digests hold no wall-clock value, the seals cover every byte; log times are simulation time in nanoseconds, so that two
equal episodes differ in nothing but their wall-clock fields and what follows from those.
"""
