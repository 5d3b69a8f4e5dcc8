"""GLSL of the city: facades, roofs and structures, roads with their lines, pavings, the shadow map, rain.

All of them read vertices of `mesh_rows.VERTEX`. A software renderer pays for every branch and every texture read, so
each material is a program of its own, with wet and night code in it only when it rains or is dark (`WET`, `NIGHT`).
Detail that a pixel cannot hold fades into its mean: line and window edges are box-filtered with `fwidth`; where no
pixel holds any, `BLUNT` variants know the mean alone. `EVEN` variants leave out the grain.
"""

from __future__ import annotations

from lingjing.engines.camera.shaders import COMMON, OUTPUTS

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
flat out vec3 v_normal, v_sunned;
flat out vec4 v_colour, v_style;
flat out float v_layer;
flat out uint v_id;
out vec2 v_at;
#ifdef SUNLIT
uniform mat4 u_shade;         // world → shadow map (0..1, depth along the sun's rays)
uniform float u_shade_step;   // metres that a surface is lifted before it is looked up: else it shades itself
out vec3 v_shade;
#endif
#ifdef WALL
flat out vec4 v_panes;        // half of a pane across and up, above and on the lowest floor
#endif
#ifdef ROAD
flat out vec4 v_left, v_right, v_ends;
#endif
void main() {
  vec3 n = dot(in_normal, u_eye - in_position) < 0.0 ? -in_normal : in_normal;
  v_world = in_position;
  v_normal = n;
  v_sunned = u_sunlight * max(dot(n, u_sun), 0.0);
  v_colour = in_colour;
  v_style = in_style;
  v_layer = in_layer;
  v_at = in_at;
  v_id = in_id;
#ifdef SUNLIT
  v_shade = (u_shade * vec4(in_position + n * u_shade_step, 1.0)).xyz;
#endif
#ifdef WALL
  v_at = in_at / in_style.xy;
  v_panes = 0.5 * in_style.zwzw;
  if (in_style.x > 2.5 && in_style.z > 0.01 && in_style.z < 0.9) v_panes.zw = max(v_panes.zw, vec2(0.30, 0.36));
#endif
#ifdef ROAD
  float left = mod(in_style.z, 4.0), right = floor(in_style.z / 4.0);
  v_left = vec4(abs(left - 1.0) < 0.1, abs(left - 2.0) < 0.1, left > 2.5, 0.0);
  v_right = vec4(abs(right - 1.0) < 0.1, abs(right - 2.0) < 0.1, 0.0, 0.0);
  v_ends = vec4(mod(in_style.w, 2.0), mod(floor(in_style.w / 2.0), 2.0), in_style.w > 3.5, 0.0);
#endif
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
uniform sampler2D u_grain;    // tone of paving, bare patches, tone of asphalt, wear of paint; `GRAIN_M` across
uniform sampler2D u_paved, u_street, u_tone;  // the first two of them, the last two, the tone of asphalt: fewer bytes
const float GRAIN_M = 64.0, MEAN_GRAIN = 0.537;
in vec3 v_world;
flat in vec3 v_normal, v_sunned;
flat in vec4 v_colour, v_style;
flat in float v_layer;
flat in uint v_id;
in vec2 v_at;
#ifdef SUNLIT
uniform sampler2DShadow u_shadow;
in vec3 v_shade;
float sunny() { return texture(u_shadow, v_shade); }
#else
#ifdef AVERTED
float sunny() { return 0.0; }
#else
float sunny() { return 1.0; }
#endif
#endif
float hash(vec2 p, float seed) {
  vec3 q = fract(vec3(p.xyx + seed * 0.37) * vec3(0.1031, 0.1030, 0.0973));
  q += dot(q, q.yzx + 33.33);
  return fract((q.x + q.y) * q.z);
}
"""
)

_TAIL = """
  o_colour = developed(mix(u_haze * (1.0 - 0.6 * max(v.z, 0.0)), c, exp2(-u_fog * range)));
  o_id = v_id;
  o_depth = 1.0 / gl_FragCoord.w;
}
"""

_RAY = """
  vec3 v = u_eye - v_world;
  float range2 = dot(v, v), closeness = inversesqrt(range2), range = range2 * closeness;
  v *= closeness;
"""

_GROUND_TAIL = (
    _RAY
    + """
#ifdef WET
  float f = 1.0 - v.z;
  float paved = smoothstep(1.25, 1.05, v_colour.g / v_colour.r);
  float puddle = (0.22 + 0.55 * smoothstep(0.62, 0.80, asphalt)) * mix(0.12, 1.0, paved);
  c *= 0.60;
#endif
  c *= v_sunned * sunny() + u_skylight;
#ifdef WET
  c += sky_of(vec3(-v.xy, v.z)) * (0.03 + 0.80 * f * f * f * f * f) * puddle;
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
flat in vec4 v_panes;
void main() {
#ifdef BLUNT
  vec2 whole = 2.0 * v_panes.xy;
  float glass = whole.x * whole.y, far = 1.0, frame = 0.0, h = 0.5;
#else
  vec2 number = floor(v_at), f = abs(v_at - number - 0.5);
  vec2 w = fwidth(v_at) + 1e-5, sharpness = 1.0 / w;
  vec2 half_glass = number.y < 0.5 ? v_panes.zw : v_panes.xy;
  float some = float(v_panes.x > 0.005);
  vec2 edge = (half_glass - f) * sharpness + 0.5;
  vec2 pane = mix(clamp(edge, 0.0, 1.0), 2.0 * half_glass, clamp(w - 0.5, 0.0, 1.0));
  float glass = pane.x * pane.y;
  vec2 rim = clamp(edge + vec2(0.03, 0.04) * sharpness, 0.0, 1.0);
  float far = clamp((max(w.x, w.y) - 0.35) * 1.33, 0.0, 1.0);
  float frame = clamp(rim.x * rim.y * some - glass, 0.0, 1.0) * (1.0 - far);
  float h = mix(hash(number, v_layer), 0.5, far);
#endif
  float up = v_at.y * v_style.y;
"""
    + _RAY
    + """
#ifdef EVEN
  float grain = MEAN_GRAIN;
#else
  float grain = texture(u_tone, (v_at * v_style.xy) * vec2(0.6, 1.1) / GRAIN_M + v_layer * 0.013).r;
#endif
  vec3 wall = v_colour.rgb * (0.80 + 0.36 * grain) * (0.72 + 0.28 * clamp(up * 0.4, 0.0, 1.0));
  wall = mix(wall, wall * 0.72 + 0.03, frame);
#ifdef WET
  wall *= 0.78;
#endif
  float lit = sunny();
  vec3 light = v_sunned * lit + u_skylight * (0.56 + 0.12 * clamp(up * 0.04, 0.0, 1.0));
  float facing = dot(v_normal, v);
  vec3 r = 2.0 * facing * v_normal - v;
  float k = 1.0 - max(facing, 0.0);
  k *= k;
  float fresnel = 0.05 + v_colour.a * 0.34 + 0.55 * k * k;
  vec3 mirrored = sky_of(r) * (0.34 + 0.66 * clamp((r.z + 0.10 * h + 0.20) * 3.0, 0.0, 1.0));
  vec3 body = mix(vec3(0.018, 0.026, 0.034), v_colour.rgb * 0.32, v_colour.a) * (0.55 + 0.9 * h);
  body = h > 0.78 ? mix(body, vec3(0.30, 0.28, 0.25), 0.55 * (1.0 - v_colour.a) * (1.0 - far)) : body;
  float glint = max(dot(r, u_sun), 0.0);
  glint *= glint; glint *= glint; glint *= glint; glint *= glint; glint *= glint; glint *= glint;
  vec3 pane_light = body * light * 1.1 + mirrored * fresnel + u_sunlight * (lit * glint * 0.5);
  vec3 c = mix(wall * light, pane_light, glass);
#ifdef NIGHT
#ifdef BLUNT
  float on = 0.38;
#else
  float on = mix(step(hash(number + 17.0, v_layer + 3.0), 0.38), 0.38, far);
#endif
  vec3 lamp = mix(vec3(0.95, 0.62, 0.30), vec3(0.80, 0.84, 0.90), step(0.6, fract(h * 7.3)));
  c += lamp * on * glass * u_dark * (0.25 + 0.5 * h) + wall * vec3(0.20, 0.15, 0.09) * u_dark * exp2(-up * 0.25);
#endif
"""
    + _TAIL
)

PLAIN = (
    _HEAD
    + """
void main() {
  vec3 n = v_normal;
"""
    + _RAY
    + """
#ifdef EVEN
  float grain = MEAN_GRAIN;
#else
  float grain = texture(u_tone, v_world.xy * (2.0 / GRAIN_M) + v_world.z * 0.031).r;
#endif
  vec3 c = v_colour.rgb * (0.78 + 0.40 * grain);
#ifdef WET
  c *= 0.72;
#endif
  c *= v_sunned * sunny() + u_skylight * (0.62 + 0.38 * n.z);
#ifdef WET
  float f = 1.0 - max(dot(n, v), 0.0);
  c += sky_of(reflect(-v, n)) * max(n.z, 0.0) * (0.03 + 0.4 * f * f * f);
#endif
"""
    + _TAIL
)

ROAD = (
    _HEAD
    + """
flat in vec4 v_left, v_right, v_ends;
void main() {
  float past = v_at.y, left_over = v_style.y - v_at.y, half_wide = v_style.x;
  vec2 w = fwidth(v_at) + 1e-4, sharpness = 1.0 / w;
  float aside = half_wide - abs(v_at.x);
  vec4 lines = v_at.x > 0.0 ? v_left : v_right;
  vec4 low = vec4(aside - 0.12, past - 0.8, left_over - 0.8, left_over - 4.8) * sharpness.xyyy;
  vec4 high = vec4(0.27 - aside, 3.8 - past, 3.8 - left_over, 5.2 - left_over) * sharpness.xyyy;
  vec4 band = clamp(min(low, high) + 0.5, 0.0, 1.0) * clamp(vec4(0.15, 3.0, 3.0, 0.4) * sharpness.xyyy, 0.0, 1.0);
  float dash = abs(mod(past, 9.0) - 4.5);
  dash = mix(clamp((dash - 3.0) * sharpness.y + 0.5, 0.0, 1.0), 0.333, clamp(0.25 * w.y - 0.5, 0.0, 1.0));
  dash *= clamp((0.075 - aside) * sharpness.x + 0.5, 0.0, 1.0) * clamp(0.15 * sharpness.x, 0.0, 1.0);
  float clear = 1.0 - max(float(past < 5.0) * v_ends.x, float(left_over < 5.2) * v_ends.y);
  float bars = mix(clamp((0.228 - 0.95 * abs(fract(v_at.x / 0.95) - 0.5)) * sharpness.x + 0.5, 0.0, 1.0), 0.48,
                   clamp(1.7 * w.x - 0.7, 0.0, 1.0));
  float white = (lines.x * band.x + lines.y * dash) * clear + v_ends.z * band.w
              + bars * (v_ends.x * band.y + v_ends.y * band.z);
  float yellow = lines.z * band.x * clear;

  vec2 grain = texture(u_street, v_world.xy / GRAIN_M).rg;
  float asphalt = grain.r;
  float track = abs(abs(v_at.x) - 0.85);
  vec3 c = v_colour.rgb * (0.66 + 0.66 * asphalt);
  c *= 1.0 - 0.16 * clamp(1.25 - 2.5 * track, 0.0, 1.0) * float(half_wide > 0.1);
  float worn = 0.55 + 0.45 * grain.g;
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
#ifdef WET
  vec3 grain = texture(u_grain, v_world.xy / GRAIN_M).rgb;
  float asphalt = grain.b;
#else
  vec2 grain = texture(u_paved, v_world.xy / GRAIN_M).rg;
#endif
  vec3 c = v_colour.rgb * (1.0 + v_style.z * (grain.r * 2.0 - 1.0));
  c = mix(c, PATCH, grain.g * v_style.w);
#ifdef ALOFT
  c = country(c, v_world.xy);
#endif
"""

_JOINTS = """
  float spacing = 1.0 / v_style.x;
  vec2 joint = abs(fract(v_world.xy * spacing) - 0.5);
  vec2 w = fwidth(v_world.xy) * spacing;
  vec2 seam = clamp((joint - 0.485) / w + 0.5, 0.0, 1.0) * clamp(1.0 - 2.0 * w, 0.0, 1.0);
  c *= 1.0 - v_style.y * max(seam.x, seam.y);
"""

_MAP_HEAD = """
#ifdef ALOFT
uniform sampler2D u_noise, u_clouds;
vec3 country(vec3 c, vec2 at) {   // woods, and fields of a few hundred metres: what tells country from lawn from orbit
  vec2 bent = at + 260.0 * (texture(u_noise, at / 9100.0).rg - 0.5);
  vec2 lot = mat2(0.94, 0.34, -0.34, 0.94) * bent / vec2(430.0, 270.0);
  lot.y += 0.5 * mod(floor(lot.x), 2.0);
  vec4 crop = textureLod(u_noise, (floor(lot) + 0.5) * vec2(0.137, 0.071), 0.0);
  vec3 field = mix(c, vec3(0.165, 0.150, 0.072), 0.75 * smoothstep(0.45, 0.75, crop.r));
  field = mix(field, vec3(0.070, 0.115, 0.034), 0.8 * smoothstep(0.5, 0.75, crop.g)) * (0.75 + 0.5 * crop.b);
  float wood = texture(u_clouds, at / 17000.0).r + 0.22 * (texture(u_noise, at / 2300.0).b - 0.5);
  wood += 0.3 * (texture(u_noise, at.yx / 83000.0).g - 0.5);
  vec3 seen = mix(field, vec3(0.034, 0.056, 0.020), 0.85 * smoothstep(0.50, 0.62, wood));
  vec2 step_m = fwidth(at);
  float blur = smoothstep(150.0, 900.0, max(step_m.x, step_m.y));   // where no pixel holds a field
  return mix(seen, 0.45 * c + vec3(0.016, 0.026, 0.010), blur);
}
#endif
#ifdef MAPPED
uniform sampler2D u_map;
uniform vec4 u_map_bounds;      // west, south, 1 / width, 1 / height
uniform vec2 u_map_range;       // from here on the map takes over, until there
#endif
"""

_MAP = """
#ifdef MAPPED
  vec2 uv = (v_world.xy - u_map_bounds.xy) * u_map_bounds.zw;
  vec3 mapped = texture(u_map, uv).rgb;
  mapped *= mapped;
  vec2 out_of = step(0.5, abs(uv - 0.5));
  float away = length(u_eye - v_world);
  c = mix(c, mapped, smoothstep(u_map_range.x, u_map_range.y, away) * (1.0 - max(out_of.x, out_of.y)));
#endif
"""

SOIL = (
    _HEAD
    + _MAP_HEAD
    + """
#define PATCH vec3(0.125, 0.135, 0.060)
void main() {
"""
    + _PAVE
    + _MAP
    + """
#ifdef NIGHT
  vec3 glow = c * vec3(0.34, 0.25, 0.15);
#endif
"""
    + _GROUND_TAIL
)

PAVING = SOIL.replace(_PAVE, _PAVE + _JOINTS)

GROUND = (
    _HEAD
    + _MAP_HEAD
    + """
#define PATCH vec3(0.110, 0.130, 0.058)
void main() {
"""
    + _PAVE
    + _MAP
    + """
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
    """A source with the wanted switches defined: `WALL`, `ROAD`, `LAYERED`, `SUNLIT`, `AVERTED`, `MAPPED`,
    `BLUNT`, `EVEN`, `WET`, `NIGHT`, `ALOFT`."""
    lines = "".join(f"#define {name.upper()}\n" for name, on in wanted.items() if on)
    return source.replace("#version 330\n", f"#version 330\n{lines}", 1)
