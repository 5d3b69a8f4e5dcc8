"""The trace: one MCAP file per episode. Everything after the episode is computed from it.

Concepts:

- A *record* is a frozen structure, such as a receipt or an observation. A *boundary* is the state of the episode
  between two decision ticks. One boundary record holds everything that happened since the previous boundary.
- *MCAP* is an open container format for time-stamped messages. Each message is on a *topic*. A *chunk* is a compressed
  block of messages. The trace has two kinds of topics: the project's own records in JSON, which are read back, and
  messages in Foxglove's schemas, which are derived from the records so that viewers can open the file.
- A *digest* is a hash over the parts of the records that decide results. Two runs are equal if their digests are equal.
  Wall-clock values, pixels and free text are left out.
- A *seal* is a hash over bytes of the file. Digests compare episodes; seals detect changes to a file. A seal may be
  signed with a key.

Modules in the order in which data passes through them:

- `records`: the record types
- `request_ids`: ids of commands, messages and other requests
- `images`: encoding and decoding of pictures
- `encoding`: deterministic JSON of records
- `digest`: the digests of boundaries, pictures and policy inputs, and `verify`, which compares records with digests
- `digest_form`: the fields that a digest covers, under frozen names, in each version
- `schemas`: JSON Schemas of the records; `python -m lingjing.trace.schemas` writes them
- `topics`: topic names
- `admitted_messages`: the messages that the bus admitted at a boundary
- `occurrences`: the occurrences of the mission's events, read back from records
- `surroundings`: the city and the camera mounts, as input for viewers
- `foxglove`: poses, scene, images, logs and geographic positions in Foxglove's schemas; `foxglove_city`: the city;
  `wire`: Protocol Buffers messages assembled from encoded parts
- `viewer_messages`: the sequence of messages for viewers
- `seals`: the hash chain over the bytes, and its signature
- `container`: the MCAP file; only this module, `chunks` and `seal_difference` import `mcap`
- `chunks`: one chunk, unpacked within limits
- `writer`: `TraceWriter`
- `calls`: records of calls to chat models; `call_store`: the SQLite file beside the trace that stores them
- `tables`: the records as rows and as data frames
- `reader`: `read_trace`, which is `lingjing.read`
- `copying`: copies of a trace under another header
- `following`: `TraceFollower`, for a trace that is still being written
- `seal_difference`: the first record that differs from its seal
- `seal_check`: comparison of the bytes with the seals
- `verification`: `verify_file`, which checks bytes and records

Invariants:

- A file with a name that ends in `.part` is unfinished. It can be read to its last complete boundary wherever it was
  cut.
- The digests cover no wall-clock value. The seals cover every byte.
- Log times are simulation time in nanoseconds. Two equal episodes differ only in wall-clock fields and in values that
  depend on them.
"""
