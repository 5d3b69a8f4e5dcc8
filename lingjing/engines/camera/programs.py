"""GLSL programs from `shaders/*.glsl`, with fragment shaders that read no uniforms.

`source` reads a file with its includes, after definitions of switches. A software renderer checks the bounds of every
uniform that a fragment shader reads, in every pixel. This is half of the cost of a pixel of a street. So the vertex
shader passes uniforms on as flat varyings, which are values of a triangle and are read once for many pixels. The
numbers are the same, and so are the pictures. The files name uniforms; `carried` rewrites them.
"""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files

import moderngl

INCLUDED = re.compile(r'^#include "([\w.]+)\.glsl"$', re.MULTILINE)
DECLARED = re.compile(r"^uniform\s+(float|vec[234]|mat4)\s+([\w\s,]+);", re.MULTILINE)
MAIN = "void main() {"


def source(name: str, *defined: str) -> str:
    """Return the source `shaders/<name>.glsl` with its includes, after a definition of each switch (`WET`, `SURFACE
    3`)."""
    return "#version 330\n" + "".join(f"#define {switch}\n" for switch in defined) + _text(name)


@cache
def _text(name: str) -> str:
    text = (files("lingjing.engines.camera") / "shaders" / f"{name}.glsl").read_text("utf-8")
    return INCLUDED.sub(lambda match: _text(match[1]), text)


def build(context: moderngl.Context, vertex: str, fragment: str) -> moderngl.Program:
    """Return the program of two sources; the vertex shader carries the uniforms of the fragment shader."""
    vertex, fragment = carried(vertex, fragment)
    return context.program(vertex_shader=vertex, fragment_shader=fragment)


def carried(vertex: str, fragment: str) -> tuple[str, str]:
    """Return both sources, with each uniform `u_x` of the fragment shader replaced by a flat varying `k_x`.

    Samplers stay. The linker removes varyings that the fragment shader does not use.
    """
    vertex, fragment = active(vertex), active(fragment)
    kinds = uniforms(fragment)
    missing = {name: kind for name, kind in kinds.items() if name not in uniforms(vertex)}
    head = "".join(f"uniform {kind} {name};\n" for name, kind in missing.items())
    head += "".join(f"flat out {kind} {_varying(name)};\n" for name, kind in kinds.items())
    copies = "".join(f"  {_varying(name)} = {name};\n" for name in kinds)
    fragment = DECLARED.sub(r"flat in \1 \2;", fragment)
    fragment = re.sub(r"\bu_\w+\b", lambda match: _varying(match[0]) if match[0] in kinds else match[0], fragment)
    return vertex.replace(MAIN, f"{head}{MAIN}\n{copies}", 1), fragment


def uniforms(source: str) -> dict[str, str]:
    """Return the types of a source's uniforms by name, without samplers."""
    return {name.strip(): kind for kind, names in DECLARED.findall(source) for name in names.split(",")}


def active(source: str) -> str:
    """Return the lines of a source that remain after `#ifdef`, `#else` and `#endif`."""
    defined: set[str] = set()
    open_: list[bool] = []
    kept = []
    for line in source.splitlines():
        word, _, rest = line.strip().partition(" ")
        if word == "#ifdef":
            open_.append(rest.strip() in defined)
        elif word == "#else":
            open_[-1] = not open_[-1]
        elif word == "#endif":
            open_.pop()
        elif all(open_):
            if word == "#define":
                defined.add(rest.split()[0])
            kept.append(line)
    return "\n".join(kept) + "\n"


def _varying(uniform: str) -> str:
    return "k_" + uniform.removeprefix("u_")


__all__ = ["active", "build", "carried", "source", "uniforms"]
