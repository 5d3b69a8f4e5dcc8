"""An episode to look at: a page for the browser, live or afterwards, and a film.

- `state`     what a watcher knows at a boundary: places, trails, commands, messages, events
- `ground`    the city as flat shapes with heights, for the page
- `head`      what a page is told of an episode once: agents, stages, regions, the view
- `steps`     what a page is told of each boundary
- `narrated`  a trace as head and steps, and the ending in words
- `page`      the one page, with its script and style inside
- `single`    the page with an episode in it as one file
- `moments`   the moments that explain an episode
- `frames`    the frames of a film
- `film`      the film as a file
- `told`      records as a watcher may know them
- `rerun_recording` a trace as a Rerun recording with its blueprint
- `foxglove_layout` a layout for Foxglove; `file_server` the trace for Foxglove over HTTP; `foxglove_server` an episode
  that is still played, over Foxglove's protocol
- `admission` which requests and connections a local server admits; `server` the page over HTTP for this machine alone
- `served`    what a server shows of a finished trace
- `live`      what it shows of one that is still written

In come records, cities and traces; nothing goes back. Hidden targets, true boxes and what is derived from them leave
this package only where the caller asks for the truth.
"""
