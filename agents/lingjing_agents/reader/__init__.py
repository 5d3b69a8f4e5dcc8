"""The request-only player: a "model" that is a program, behind `react` and a real HTTP service on loopback.

It answers from the texts and pictures of its requests alone, with the rules of `heuristic`. So an episode that it wins
shows that the requests of `react` say enough to win. Two policies use it:

- `reader`: sees with the shipped colour rules, in the JPEG files of the requests.
- `sighted-reader`: gets the true boxes of exactly the pictures of its requests. It measures the requests without the
  perception.

`request_text` reads a request, `player` answers it, `service` speaks HTTP, `policy` joins them with `react`,
and `true_boxes` are the eyes of `sighted-reader`.
"""
