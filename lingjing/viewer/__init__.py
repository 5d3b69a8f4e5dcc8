"""Presentation of an episode: a page for the browser, a film, a Rerun recording and a view for Foxglove.

Concepts:

- The *page* consists of a *head* (agents, stages, regions, the shown extent), a *step* for each boundary (movements,
  pictures, events), *details* (thoughts, messages, receipts), the *ground* (the city as shapes) and the *ending*.
- The *truth* is the set of hidden targets, true boxes and everything derived from them. It is shown only if the caller
  requests it. A target is *known* (not hidden), *found*, *completed*, or shown as *truth*.
- A page is a single file, or comes from a server on this machine. The server shows a finished trace or one that is
  still being written.

Modules in the order in which data passes through them:

- `state`: the visible state of an episode at a boundary: positions, trails, commands, messages, events
- `ground`: the city as flat shapes with heights
- `head`: the head and the ending
- `steps`: steps and details
- `page_content`: head, steps, details and ending of a trace
- `page`: the HTML page with its script and style
- `single`: the page with an episode as one file
- `inline`: that page in the frame of a notebook
- `calls_page`: the recorded model calls as a page; `inspect_log`: the same as a log of Inspect
- `moments`: the moments of an episode that a film points out
- `frames`: the frames of a film; `film`: the film as a file
- `episode_view`: records without the truth
- `rerun_recording`: a trace as a Rerun recording with its blueprint
- `foxglove_layout`: a layout for Foxglove; `file_server`: the trace for Foxglove over HTTP; `foxglove_server`: a
  running episode over Foxglove's protocol
- `admission`: admission of requests and connections to a local server; `server`: the page over HTTP
- `trace_source`: the content for a server from a finished trace; `live`: the same from a trace that is being written

The package reads records, cities and traces. It changes nothing.
"""
