"""GLSL sources (`shaders/*.glsl`) → programs whose fragments read no uniforms: vertices hand them on as flat varyings.

`source` reads a file with what it includes and defines switches in it. A software renderer checks the bounds of every
uniform that a fragment reads, in every pixel: half of what a pixel of a street costs. A flat varying is a value of the
triangle, read once for many pixels. The numbers are the same, and so are the pictures. Sources stay as they are
written: fragments name uniforms, `carried` rewrites them.
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
    """The source `shaders/<name>.glsl` with what it includes, each of `defined` (`WET`, `SURFACE 3`) defined first."""
    return "#version 330\n" + "".join(f"#define {switch}\n" for switch in defined) + _text(name)


@cache
def _text(name: str) -> str:
    text = (files("lingjing.engines.camera") / "shaders" / f"{name}.glsl").read_text("utf-8")
    return INCLUDED.sub(lambda found: _text(found[1]), text)


def build(context: moderngl.Context, vertex: str, fragment: str) -> moderngl.Program:
    """The program of two sources, uniforms of the fragments carried by the vertices."""
    vertex, fragment = carried(vertex, fragment)
    return context.program(vertex_shader=vertex, fragment_shader=fragment)


def carried(vertex: str, fragment: str) -> tuple[str, str]:
    """Both sources with each uniform `u_x` of the fragments replaced by a flat varying `k_x`; samplers stay.

    What the fragments do not use, the linker leaves out again."""
    vertex, fragment = active(vertex), active(fragment)
    kinds = uniforms(fragment)
    missing = {name: kind for name, kind in kinds.items() if name not in uniforms(vertex)}
    head = "".join(f"uniform {kind} {name};\n" for name, kind in missing.items())
    head += "".join(f"flat out {kind} {_varying(name)};\n" for name, kind in kinds.items())
    copies = "".join(f"  {_varying(name)} = {name};\n" for name in kinds)
    fragment = DECLARED.sub(r"flat in \1 \2;", fragment)
    fragment = re.sub(r"\bu_\w+\b", lambda found: _varying(found[0]) if found[0] in kinds else found[0], fragment)
    return vertex.replace(MAIN, f"{head}{MAIN}\n{copies}", 1), fragment


def uniforms(source: str) -> dict[str, str]:
    """The types of a source's uniforms by name, without samplers."""
    return {name.strip(): kind for kind, names in DECLARED.findall(source) for name in names.split(",")}


def active(source: str) -> str:
    """The lines that `#ifdef`, `#else` and `#endif` leave of a source."""
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
