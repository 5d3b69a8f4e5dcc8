"""GLSL of the city: facades, roofs and structures, roads with their lines, pavings, the shadow map, rain.

All of them read vertices of `mesh_rows.VERTEX`. A software renderer pays for every branch and every texture read, so
each material is a program of its own, with wet and night code in it only when it rains or is dark (`WET`, `NIGHT`).
Detail that a pixel cannot hold fades into its mean: line and window edges are box-filtered with `fwidth`.
"""

from __future__ import annotations

from lingjing.plugins.engines.camera.shaders import COMMON, OUTPUTS

VERTEX = (
    COMMON
    + """
uniform float u_layer;
in vec3 in_position, in_normal;
in vec4 in_colour, in_style;
in vec2 in_at;
in float in_layer;
in uint in_id;
out vec3 v_world;
flat out vec3 v_normal;
flat out vec4 v_colour, v_style;
flat out float v_layer;
flat out uint v_id;
out vec2 v_at;
void main() {
  v_world = in_position;
  v_normal = in_normal;
  v_colour = in_colour;
  v_style = in_style;
  v_layer = in_layer;
  v_at = in_at;
  v_id = in_id;
  gl_Position = u_clip * vec4(in_position - u_eye, 1.0);
#ifdef LAYERED
  gl_Position.z -= u_layer * in_layer * gl_Position.w;
#endif
}
"""
)

_HEAD = (
    COMMON
    + OUTPUTS
    + """
uniform sampler2D u_noise;
in vec3 v_world;
flat in vec3 v_normal;
flat in vec4 v_colour, v_style;
flat in float v_layer;
flat in uint v_id;
in vec2 v_at;
float hash(vec2 p, float seed) {
  vec3 q = fract(vec3(p.xyx + seed * 0.37) * vec3(0.1031, 0.1030, 0.0973));
  q += dot(q, q.yzx + 33.33);
  return fract((q.x + q.y) * q.z);
}
float cover(float d, float a, float b, float w) {      // share of a pixel of width w at d that lies in a..b
  return clamp((min(d + 0.5 * w, b) - max(d - 0.5 * w, a)) / w, 0.0, 1.0);
}
"""
)

_TAIL = """
  float range = length(u_eye - v_world);
  o_colour = developed(fogged(c, range, max((u_eye.z - v_world.z) / range, 0.0)));
  o_id = v_id;
  o_depth = dot(v_world - u_eye, u_axis);
}
"""

_GROUND_TAIL = (
    """
  float lit = sunlit(v_world, vec3(0.0, 0.0, 1.0));
#ifdef WET
  vec3 ray = normalize(v_world - u_eye);
  float f = 1.0 + ray.z;
  float paved = smoothstep(1.25, 1.05, v_colour.g / v_colour.r);
  float puddle = (0.22 + 0.55 * smoothstep(0.54, 0.66, texture(u_noise, v_world.xy / 19.0).r)) * mix(0.12, 1.0, paved);
  c *= 0.60;
#endif
  c *= u_sunlight * max(u_sun.z, 0.0) * lit + u_skylight;
#ifdef WET
  c += sky_of(vec3(ray.xy, -ray.z)) * (0.03 + 0.80 * f * f * f * f * f) * puddle;
#endif
#ifdef NIGHT
  c += glow * u_dark;
#endif
"""
    + _TAIL
)

WALL = (
    _HEAD
    + """
void main() {
  vec2 cell = v_at / v_style.xy;
  vec2 number = floor(cell), f = abs(cell - number - 0.5);
  vec2 w = fwidth(cell) + 1e-5;
  vec2 half_glass = 0.5 * v_style.zw;
  float some = step(0.01, v_style.z);
  float foot = step(v_at.y, v_style.y) * step(2.5, v_style.x) * step(v_style.z, 0.9);
  half_glass = mix(half_glass, max(half_glass, vec2(0.30, 0.36)) * some, foot);
  vec2 sharp = clamp((half_glass - f) / w + 0.5, 0.0, 1.0);
  vec2 pane = mix(sharp, 2.0 * half_glass, smoothstep(0.5, 1.5, w));
  float glass = pane.x * pane.y;
  float frame = clamp((half_glass.x + 0.03 - f.x) / w.x + 0.5, 0.0, 1.0)
              * clamp((half_glass.y + 0.04 - f.y) / w.y + 0.5, 0.0, 1.0) * some - glass;
  float far = smoothstep(0.35, 1.1, max(w.x, w.y));
  float h = mix(hash(number, v_layer), 0.5, far);

  vec3 n = v_normal;
  vec3 to_eye = u_eye - v_world;
  vec3 v = normalize(to_eye);
  vec4 grain = texture(u_noise, v_at / vec2(41.0, 23.0) + v_layer * 0.013);
  vec3 wall = v_colour.rgb * (0.80 + 0.36 * grain.r) * (0.72 + 0.28 * smoothstep(0.0, 3.0, v_at.y));
  wall = mix(wall, wall * 0.72 + 0.03, clamp(frame, 0.0, 1.0) * (1.0 - far));
#ifdef WET
  wall *= 0.78;
#endif
  float lit = sunlit(v_world, n);
  float facing = max(dot(n, u_sun), 0.0);
  float open = 0.56 + 0.12 * smoothstep(0.0, 25.0, v_at.y);
  vec3 light = u_sunlight * facing * lit + u_skylight * open;
  vec3 c = wall * light;

  vec3 r = reflect(-v, n);
  float k = 1.0 - max(dot(n, v), 0.0);
  float fresnel = 0.05 + v_colour.a * 0.34 + 0.55 * k * k * k * k;
  vec3 mirrored = sky_of(r) * mix(0.34, 1.0, smoothstep(-0.25, 0.08, r.z + 0.10 * (h - 0.5)));
  vec3 body = mix(vec3(0.018, 0.026, 0.034), v_colour.rgb * 0.32, v_colour.a) * (0.55 + 0.9 * h);
  body = mix(body, vec3(0.30, 0.28, 0.25), step(0.78, h) * 0.55 * (1.0 - v_colour.a) * (1.0 - far));
  vec3 pane_light = body * light * 1.1 + mirrored * fresnel;
  float glint = max(dot(r, u_sun), 0.0);
  glint *= glint; glint *= glint; glint *= glint; glint *= glint; glint *= glint; glint *= glint;
  pane_light += u_sunlight * lit * glint * 0.5;
  c = mix(c, pane_light, glass);
#ifdef NIGHT
  float on = mix(step(hash(number + 17.0, v_layer + 3.0), 0.38), 0.38, far);
  vec3 lamp = mix(vec3(0.95, 0.62, 0.30), vec3(0.80, 0.84, 0.90), step(0.6, fract(h * 7.3)));
  c += lamp * on * glass * u_dark * (0.25 + 0.5 * h) + wall * vec3(0.20, 0.15, 0.09) * u_dark * exp2(-v_at.y * 0.25);
#endif
"""
    + _TAIL
)

PLAIN = (
    _HEAD
    + """
void main() {
  vec3 n = v_normal;
  vec3 to_eye = u_eye - v_world;
  n = dot(n, to_eye) < 0.0 ? -n : n;
  vec4 grain = texture(u_noise, v_world.xy / 23.0 + v_world.z * 0.031);
  vec3 c = v_colour.rgb * (0.78 + 0.40 * grain.r);
#ifdef WET
  c *= 0.72;
#endif
  c *= u_sunlight * max(dot(n, u_sun), 0.0) * sunlit(v_world, n) + u_skylight * (0.62 + 0.38 * n.z);
#ifdef WET
  vec3 v = normalize(to_eye);
  float f = 1.0 - max(dot(n, v), 0.0);
  c += sky_of(reflect(-v, n)) * max(n.z, 0.0) * (0.03 + 0.4 * f * f * f);
#endif
"""
    + _TAIL
)

ROAD = (
    _HEAD
    + """
void main() {
  float half_wide = v_style.x, past = v_at.y, left_over = v_style.y - v_at.y;
  vec2 w = fwidth(v_at) + 1e-4;
  float to_left = half_wide - v_at.x, to_right = half_wide + v_at.x;
  float left = mod(v_style.z, 4.0), right = floor(v_style.z / 4.0);
  float start_zebra = mod(v_style.w, 2.0), end_zebra = mod(floor(v_style.w / 2.0), 2.0), stop = step(3.5, v_style.w);

  float dash = mix(cover(mod(past, 9.0), 0.0, 3.0, min(w.y, 3.0)), 0.333, smoothstep(2.0, 6.0, w.y));
  float clear = 1.0 - max(step(past, 5.0) * start_zebra, step(left_over, 5.2) * end_zebra);
  float white = (step(abs(left - 1.0), 0.1) * cover(to_left, 0.12, 0.27, w.x)
              + step(abs(left - 2.0), 0.1) * cover(to_left, -0.5, 0.075, w.x) * dash
              + step(abs(right - 1.0), 0.1) * cover(to_right, 0.12, 0.27, w.x)
              + step(abs(right - 2.0), 0.1) * cover(to_right, -0.5, 0.075, w.x) * dash) * clear;
  float yellow = step(2.5, left) * cover(to_left, 0.07, 0.21, w.x) * clear;
  float bars = mix(clamp((0.24 - abs(fract(v_at.x / 0.95) - 0.5)) * 0.95 / w.x + 0.5, 0.0, 1.0), 0.5,
                   smoothstep(0.4, 1.0, w.x));
  white += bars * (start_zebra * cover(past, 0.8, 3.8, w.y) + end_zebra * cover(left_over, 0.8, 3.8, w.y));
  white += stop * cover(left_over, 4.8, 5.2, w.y);

  vec4 wide = texture(u_noise, v_world.xy / 53.0);
  vec4 fine = texture(u_noise, v_world.xy / 5.3);
  float track = abs(abs(v_at.x) - 0.85);
  vec3 c = v_colour.rgb * (0.66 + 0.42 * wide.r + 0.24 * fine.b);
  c *= 1.0 - 0.16 * smoothstep(0.5, 0.1, track) * step(0.1, half_wide);
  float worn = 0.55 + 0.45 * smoothstep(0.25, 0.45, fine.r * 0.6 + wide.g * 0.5);
  c = mix(c, vec3(0.62, 0.62, 0.60), clamp(white, 0.0, 1.0) * worn);
  c = mix(c, vec3(0.62, 0.42, 0.06), yellow * worn);
#ifdef NIGHT
  float pool = abs(fract(past / 28.0) - 0.5) * 2.0;
  vec3 glow = c * vec3(1.0, 0.72, 0.40) * (0.22 + 1.1 * pool * pool * pool);
#endif
"""
    + _GROUND_TAIL
)

_PAVE = """
  vec4 wide = texture(u_noise, mat2(0.92, 0.39, -0.39, 0.92) * v_world.xy / 83.0);
  vec4 fine = texture(u_noise, mat2(0.80, -0.60, 0.60, 0.80) * v_world.xy / 7.3);
  vec3 c = v_colour.rgb * (1.0 + v_style.z * (0.6 * (wide.r - 0.5) + 0.45 * (fine.r - 0.5) + 0.7 * (fine.b - 0.5)));
  c = mix(c, PATCH, smoothstep(0.40, 0.78, wide.g * 0.8 + fine.g * 0.2) * v_style.w);
  vec2 joint = abs(fract(v_world.xy / v_style.x) - 0.5);
  vec2 w = (abs(dFdx(v_world.xy)) + abs(dFdy(v_world.xy))) / v_style.x;
  vec2 seam = clamp((joint - 0.485) / w + 0.5, 0.0, 1.0) * clamp(0.5 - w, 0.0, 1.0) * 2.0;
  c *= 1.0 - v_style.y * max(seam.x, seam.y);
"""

PAVING = (
    _HEAD
    + """
#define PATCH vec3(0.125, 0.135, 0.060)
void main() {
"""
    + _PAVE
    + """
#ifdef NIGHT
  vec3 glow = c * vec3(0.34, 0.25, 0.15);
#endif
"""
    + _GROUND_TAIL.replace("vec3(0.0, 0.0, 1.0));", "v_normal);", 1)
)

GROUND = (
    _HEAD
    + """
#define PATCH vec3(0.110, 0.130, 0.058)
uniform sampler2D u_map;
uniform vec4 u_map_bounds;      // west, south, 1 / width, 1 / height
uniform vec2 u_map_range;       // from here on the map takes over, until there
void main() {
"""
    + _PAVE
    + """
  vec2 uv = (v_world.xy - u_map_bounds.xy) * u_map_bounds.zw;
  vec3 mapped = texture(u_map, uv).rgb;
  mapped *= mapped;
  vec2 out_of = step(0.5, abs(uv - 0.5));
  float away = length(u_eye - v_world);
  c = mix(c, mapped, smoothstep(u_map_range.x, u_map_range.y, away) * (1.0 - max(out_of.x, out_of.y)));
#ifdef NIGHT
  vec3 glow = c * vec3(0.20, 0.15, 0.09);
#endif
"""
    + _GROUND_TAIL
)

CASTER_VERTEX = """
#version 330
uniform mat4 u_light;
in vec3 in_position;
void main() { gl_Position = u_light * vec4(in_position, 1.0); }
"""

CASTER_INSTANCED = """
#version 330
uniform mat4 u_light;
in vec3 in_position;
in vec4 in_row0, in_row1, in_row2;
void main() {
  vec4 p = vec4(in_position, 1.0);
  gl_Position = u_light * vec4(dot(in_row0, p), dot(in_row1, p), dot(in_row2, p), 1.0);
}
"""

CASTER_FRAGMENT = """
#version 330
void main() {}
"""

RAIN_FRAGMENT = (
    COMMON
    + """
uniform sampler2D u_noise;
uniform float u_rain;
layout(location = 0) out vec4 o_colour;
float streaks(vec3 d, float scale, float speed) {
  // drops on a cylinder about the eye: across is the bearing, along the height on it; straight up and down they fade
  float flat_len = length(d.xy);
  float turn = atan(d.x, d.y) * scale * 3.0;
  float rise = d.z / max(flat_len, 0.05) * scale * 0.22 + u_time * speed;
  float n = textureLod(u_noise, vec2(turn * 0.31, rise * 0.045), 0.0).a;
  return smoothstep(0.80, 0.97, n) * smoothstep(0.02, 0.5, flat_len);
}
void main() {
  vec3 d = normalize(ray_of(gl_FragCoord.xy));
  float s = 0.6 * streaks(d, 3.0, 0.91) + 0.4 * streaks(d, 5.7, 0.67);
  vec3 c = (u_haze + vec3(0.05)) * 1.15;
  o_colour = vec4(developed(c).rgb, s * 0.38 * u_rain);
}
"""
)


def variant(source: str, **wanted: bool) -> str:
    """A source with the switches that are wanted defined: `LAYERED`, `SHADED`, `WET`, `NIGHT`."""
    lines = "".join(f"#define {name.upper()}\n" for name, on in wanted.items() if on)
    return source.replace("#version 330\n", f"#version 330\n{lines}", 1)
