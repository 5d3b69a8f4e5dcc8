"""The GLSL programs: ground, objects, water, sky, projected shadows, marks on the water.

One pass writes three targets: 0 RGBA8 colour (tone-mapped, gamma 2; alpha 1), 1 R16UI id, 2 R32F metres along the
optical axis. The picture is drawn upside down in GL terms (clip y is flipped), so that row 0 of a read-back is the
top row and gl_FragCoord.xy is the pixel of `lingjing.plugins.geometry`. Fog follows Koschmieder: contrast falls to
2 % at the visibility. Only float arithmetic and the textures made here decide a pixel: no time but `u_time`.
"""

from __future__ import annotations

COMMON = """
#version 330
uniform mat4 u_clip;
uniform vec3 u_eye, u_right, u_down, u_axis;
uniform vec3 u_lens;          // half width, half height, focal length (pixels)
uniform vec3 u_sun, u_sunlight, u_skylight, u_haze;
uniform float u_fog, u_level, u_time, u_cloud, u_wind;
uniform float u_dark, u_gloom, u_clear;  // 0 day … 1 night; what rain leaves of the sky's light, fog of its sight
uniform vec3 u_dusk;          // glow over the horizon, low sun
uniform vec3 u_sky_top, u_sky_rise, u_sky_low;  // the sky: at any height, more of it higher up, more of it lower down

vec3 ray_of(vec2 pixel) {
  return u_axis + ((pixel.x - u_lens.x) * u_right + (pixel.y - u_lens.y) * u_down) / u_lens.z;
}
vec3 sky_of(vec3 d) {
  float h = clamp(d.z, 0.0, 1.0), low = (1.0 - h) * (1.0 - h);
  return u_sky_top + u_sky_rise * h + (u_sky_low + u_dusk * (0.5 * dot(d.xy, u_sun.xy))) * low;
}
vec3 fogged(vec3 c, float range, float dive) {   // dive: 0 level line of sight, 1 straight down (less airlight)
  return mix(u_haze * (1.0 - 0.6 * dive), c, exp2(-u_fog * range));
}
#ifdef SHADED
uniform mat4 u_shade;         // world → shadow map (0..1, depth along the sun's rays)
uniform sampler2DShadow u_shadow;
uniform float u_shade_step;   // metres that a surface is lifted before it is looked up: else it shades itself
float sunlit(vec3 w, vec3 n) {
  vec3 s = (u_shade * vec4(w + n * u_shade_step, 1.0)).xyz;
  vec2 edge = abs(s.xy - 0.5);
  return max(texture(u_shadow, s), step(0.498, max(edge.x, edge.y)));
}
#else
float sunlit(vec3 w, vec3 n) { return 1.0; }
#endif
vec4 developed(vec3 c) {
  // v = sqrt(1 - e^-1.9c), 0.55 of the way to v^2 (3 - 2v), less than a 400th off: `uniforms.haze` says it in full
  vec3 s = sqrt(clamp(c, 0.0, 2.25));
  return vec4(s * (0.59784 + s * (3.72097 + s * (-6.43773 + s * (3.90812 - s * 0.83342)))), 1.0);
}
"""

OUTPUTS = """
layout(location = 0) out vec4 o_colour;
layout(location = 1) out uint o_id;
layout(location = 2) out float o_depth;
"""

OBJECT_VERTEX = (
    COMMON
    + """
in vec3 in_position, in_normal;
in vec4 in_colour;
in vec4 in_row0, in_row1, in_row2;
in float in_plane;
in uint in_id;
out vec3 v_world, v_normal;
out vec4 v_colour;
flat out uint v_id;
void main() {
  vec4 p = vec4(in_position, 1.0);
  v_world = vec3(dot(in_row0, p), dot(in_row1, p), dot(in_row2, p));
  v_normal = vec3(dot(in_row0.xyz, in_normal), dot(in_row1.xyz, in_normal), dot(in_row2.xyz, in_normal));
  v_colour = in_colour;
  v_id = in_id;
  gl_Position = u_clip * vec4(v_world - u_eye, 1.0);
}
"""
)

OBJECT_FRAGMENT = (
    COMMON
    + OUTPUTS
    + """
in vec3 v_world, v_normal;
in vec4 v_colour;
flat in uint v_id;
void main() {
  vec3 to_eye = u_eye - v_world;
  float range = length(to_eye);
  vec3 v = to_eye / range;
  vec3 n = normalize(v_normal);
  n = dot(n, v) < 0.0 ? -n : n;
  vec3 sun = u_sunlight * sunlit(v_world, n);
  vec3 light = sun * max(dot(n, u_sun), 0.0) + u_skylight * (0.62 + 0.38 * n.z);
#ifdef DULL
  vec3 c = v_colour.rgb * light;
#else
  vec3 h = normalize(v + u_sun);
  float shine = pow(max(dot(n, h), 0.0), 40.0) * v_colour.a;
  vec3 c = v_colour.rgb * light + sun * shine * 0.6 + sky_of(reflect(-v, n)) * v_colour.a * 0.08;
#endif
  o_colour = developed(fogged(c, range, max(v.z, 0.0)));
  o_id = v_id;
  o_depth = -dot(to_eye, u_axis);
}
"""
)

GROUND_FRAGMENT = (
    COMMON
    + OUTPUTS
    + """
uniform sampler2D u_noise;
#define SURFACE 2              // class id, replaced: 2 sand, 3 grass, 4 rock, 5 concrete
in vec3 v_world, v_normal;
in vec4 v_colour;
flat in uint v_id;
void main() {
  vec3 to_eye = u_eye - v_world;
  float range = length(to_eye);
  vec3 n = normalize(v_normal);
  vec4 wide = texture(u_noise, v_world.xy / 131.0);
  vec4 fine = texture(u_noise, mat2(0.86, 0.5, -0.5, 0.86) * v_world.xy / 37.0 + v_world.z * 0.02);
  vec3 c = v_colour.rgb * (0.72 + 0.30 * wide.r + 0.26 * fine.g) * (0.93 + 0.14 * fine.b);
  float over = v_world.z - u_level;
  if (SURFACE == 2) {
    c *= mix(0.45, 1.0, smoothstep(0.15, 0.75, over + 0.25 * (wide.g - 0.5)));
    float tangle = smoothstep(0.60, 0.80, fine.r * 0.6 + wide.g * 0.45);
    c = mix(c, vec3(0.14, 0.14, 0.06), 0.6 * tangle * smoothstep(0.9, 1.5, over));
    c = mix(c, vec3(0.10, 0.08, 0.05), 0.5 * smoothstep(0.10, 0.0, abs(over - 0.95 - 0.3 * (wide.r - 0.5))) * fine.b);
  } else if (SURFACE == 3) {
    c = mix(c, vec3(0.20, 0.18, 0.075), smoothstep(0.45, 0.8, wide.g) * 0.75);
    c = mix(c, vec3(0.17, 0.155, 0.13), smoothstep(0.90, 0.80, n.z));
    c *= 0.8 + 0.4 * fine.b;
  } else if (SURFACE == 4) {
    c *= 0.65 + 0.75 * fine.r;
    c = mix(c * 0.45, c, smoothstep(0.2, 1.1, over + 0.6 * (fine.g - 0.5)));
    c = mix(c, vec3(0.09, 0.115, 0.045), smoothstep(0.55, 0.75, wide.r) * smoothstep(3.0, 5.0, over));
  } else {
    vec2 joint = abs(fract(v_world.xy / 6.0) - 0.5);
    float seam = smoothstep(0.488, 0.496, max(joint.x, joint.y)) * step(0.5, n.z);
    c *= (1.0 - 0.35 * seam) * (0.9 + 0.2 * fine.b);
    c = mix(vec3(0.045, 0.055, 0.035), c, smoothstep(0.2, 1.2, over + (wide.g - 0.5)));
  }
  vec3 light = u_sunlight * sunlit(v_world, n) * max(dot(n, u_sun), 0.0) + u_skylight * (0.62 + 0.38 * n.z);
  o_colour = developed(fogged(c * light, range, max(to_eye.z / range, 0.0)));
  o_id = v_id;
  o_depth = -dot(to_eye, u_axis);
}
"""
)


def dull(source: str) -> str:
    """The source of objects without gloss: leaves, and what is far off."""
    return source.replace("#version 330", "#version 330\n#define DULL", 1)


def shaded(source: str) -> str:
    """A program's source with shadows from the shadow map (`u_shade`, `u_shadow`)."""
    return source.replace("#version 330", "#version 330\n#define SHADED", 1)


def aloft(source: str) -> str:
    """The source of waters for an eye high over them, which sees beyond the shore map."""
    return source.replace("#version 330", "#version 330\n#define ALOFT", 1)


def ground_fragment(cls: int) -> str:
    """The ground's fragment shader for one surface class: a branch costs a software renderer both its sides."""
    return GROUND_FRAGMENT.replace("#define SURFACE 2 ", f"#define SURFACE {cls} ")


WATER_VERTEX = (
    COMMON
    + """
in vec2 in_corner;
void main() {
  gl_Position = u_clip * vec4(in_corner * 30000.0, u_level - u_eye.z, 1.0);
}
"""
)

LAKE_VERTEX = (
    COMMON
    + """
in vec3 in_position;
void main() { gl_Position = u_clip * vec4(in_position - u_eye, 1.0); }
"""
)

WATER_FRAGMENT = (
    COMMON
    + OUTPUTS
    + """
uniform sampler2D u_swell, u_ripple, u_shore;
uniform vec2 u_swell_scale, u_ripple_scale;   // metres and slope of a full deflection
uniform vec2 u_lengths;                       // patch lengths
uniform vec4 u_bounds;                        // west, south, 1 / width, 1 / height
uniform float u_reach;
uniform float u_silt;                         // 0 the sea … 1 a slow river
void main() {
  vec3 ray = ray_of(gl_FragCoord.xy);
  float depth = (u_level - u_eye.z) / ray.z;
  vec3 p = u_eye + depth * ray;
  float range = depth * length(ray);
  vec3 v = -ray * (depth / range);

  vec4 a = texture(u_swell, p.xy / u_lengths.x);
  vec4 b = texture(u_ripple, p.xy / u_lengths.y);
  vec4 c = texture(u_ripple, mat2(0.8, 0.6, -0.6, 0.8) * p.xy / (u_lengths.y * 3.3));
  vec2 shore = texture(u_shore, (p.xy - u_bounds.xy) * u_bounds.zw).rg;
#ifdef ALOFT
  vec2 aside = smoothstep(0.40, 0.49, abs((p.xy - u_bounds.xy) * u_bounds.zw - 0.5));
  shore = mix(shore, vec2(1.0, 0.5), max(aside.x, aside.y));
#endif
  float land = shore.r * shore.r * u_reach;
  float gust = 0.55 + 0.9 * shore.g;
  vec2 slope = (a.yz * 2.0 - 1.0) * u_swell_scale.y
             + (b.yz * 2.0 - 1.0) * u_ripple_scale.y * gust
             + (c.yz * 2.0 - 1.0) * u_ripple_scale.y * 0.8 * gust;
  slope *= 0.35 + 0.65 * smoothstep(0.0, 40.0, land);
  vec3 n = normalize(vec3(-slope, 1.0));

  float facing = max(dot(n, v), 0.0);
  float f = 1.0 - facing;
  float fresnel = 0.022 + 0.978 * f * f * f * f * f;
  vec3 r = reflect(-v, n);
  r.z = abs(r.z);

  float height = (a.x * 2.0 - 1.0) * u_swell_scale.x;
  float near = 1.0 - shore.r;
  float shoal = near * near * near;
  vec3 body = mix(vec3(0.008, 0.052, 0.072), vec3(0.016, 0.074, 0.086), shore.g);
  body = mix(body, vec3(0.055, 0.215, 0.20), shoal * (0.55 + 0.45 * near));
  body = mix(body, vec3(0.27, 0.29, 0.20), shoal * shoal * shoal);
  body = mix(body, vec3(0.088, 0.105, 0.078) * (0.8 + 0.4 * shore.g), 0.85 * u_silt);
  float lit = 0.55 + 0.45 * max(dot(n, u_sun), 0.0) / max(u_sun.z, 0.2);
  body *= lit * (1.0 + 0.35 * clamp(height, -1.0, 1.6) + 1.6 * dot(slope, -u_sun.xy));
  vec3 colour = body * (0.35 * u_sunlight + u_skylight) + sky_of(r) * fresnel * 1.15;

  vec3 h = normalize(v + u_sun);
  float sharp = mix(900.0, 90.0, clamp(range / 900.0, 0.0, 1.0));
  float glint = pow(max(dot(n, h), 0.0), sharp) * (sharp + 8.0) * 0.0125;
  colour += u_sunlight * min(glint * (0.02 + fresnel * 1.5), 3.0);

  float lace = b.a * 0.75 + c.a * 0.30 + (b.x - 0.5) * 0.3;
  float foam = a.w * smoothstep(0.78 - 0.28 * a.w, 1.06 - 0.28 * a.w, lace);
  float swash = land - 1.6 + 0.8 * sin(u_time * 0.7 + c.a * 9.0) + 4.0 * (shore.g + c.a - 1.0) + 1.2 * height;
  float surf = smoothstep(0.50, 0.80, lace + 0.16 * smoothstep(1.5, -1.0, swash));
  foam = max(foam, 0.85 * smoothstep(2.6, -0.4, swash) * surf * (1.0 - u_silt));
  colour = mix(colour, vec3(0.62, 0.66, 0.67) * (0.55 * u_sunlight + u_skylight), foam);

  o_colour = developed(fogged(colour, range, v.z));
  o_id = 1u;
  o_depth = depth;
}
"""
)

SKY_VERTEX = (
    COMMON
    + """
in vec2 in_corner;
noperspective out vec3 v_ray;
void main() {
  gl_Position = vec4(in_corner * 3.0, 1.0, 1.0);
  v_ray = ray_of(u_lens.xy * (1.0 + in_corner * 3.0));
}
"""
)

SKY_FRAGMENT = (
    COMMON
    + OUTPUTS
    + """
uniform sampler2D u_clouds;
noperspective in vec3 v_ray;
void main() {
  vec3 d = v_ray * inversesqrt(dot(v_ray, v_ray));
  float rise = max(d.z, 0.0), low = (1.0 - rise) * (1.0 - rise);
  vec3 c = u_sky_top + u_sky_rise * rise + (u_sky_low + u_dusk * (0.5 * dot(d.xy, u_sun.xy))) * low;
  float glow = max(dot(d, u_sun), 0.0), off = 1.0 - glow;
  // the sun's aureole and its disc: (1 - x / 8)^8 for e^-x, about what powers of 90 and 4000 are, and cheaper
  vec3 about = vec3(glow, max(1.0 - 11.25 * off, 0.0), max(1.0 - 500.0 * off, 0.0));
  about *= about; about *= about; about *= about;
  c += u_sunlight * (0.05 * about.x + (1.0 - u_cloud) * (0.25 * about.y + 8.0 * about.z));
  vec2 at = d.xy * (0.16 / (rise + 0.06)) + u_time * vec2(2e-5, 1e-5) * u_wind;
  float puff = 1.15 * texture(u_clouds, at).r;
  float veil = smoothstep(0.95 - 0.65 * u_cloud, 1.15 - 0.45 * u_cloud, puff + 0.12) * smoothstep(0.0, 0.12, rise);
  vec3 white = vec3(0.86, 0.87, 0.88) * (0.75 + 0.3 * glow) * (1.0 - 0.97 * u_dark) * u_gloom + u_dusk * 0.5;
  c = mix(c, white, veil * 0.8);
  c = mix(u_haze, c, (1.0 - exp2(-37.5 * rise)) * u_clear);
  o_colour = developed(c);
  o_id = 0u;
  o_depth = uintBitsToFloat(0x7f800000u);
}
"""
)

BELOW_VERTEX = SKY_VERTEX.replace("noperspective out vec3 v_ray;\n", "").replace(
    "  v_ray = ray_of(u_lens.xy * (1.0 + in_corner * 3.0));\n", ""
)
"""As the sky: what lies below the horizon beyond all that is drawn."""

BELOW_FRAGMENT = (
    COMMON
    + OUTPUTS
    + """
uniform vec4 u_floor;          // its colour; 1 for water
uniform vec2 u_floor_is;       // elevation, class id
void main() {
  vec3 ray = ray_of(gl_FragCoord.xy);
  if (ray.z >= 0.0) discard;
  float depth = (u_floor_is.x - u_eye.z) / ray.z;
  float range = depth * length(ray);
  vec3 d = ray * (depth / range);
  vec3 c = u_floor.rgb * (mix(u_sun.z, 0.35, u_floor.a) * u_sunlight + u_skylight);
  float f = 1.0 + d.z;
  c += u_floor.a * sky_of(vec3(d.xy, -d.z)) * (0.022 + 0.978 * f * f * f * f * f);
  o_colour = developed(fogged(c, range, -d.z));
  o_id = uint(u_floor_is.y);
  o_depth = depth;
}
"""
)

SHADOW_VERTEX = (
    COMMON
    + """
uniform float u_layer;
in vec3 in_position;
in vec4 in_row0, in_row1, in_row2;
in float in_plane;
void main() {
  vec4 p = vec4(in_position, 1.0);
  vec3 w = vec3(dot(in_row0, p), dot(in_row1, p), dot(in_row2, p));
  w -= u_sun * (max(w.z - in_plane, 0.0) / u_sun.z);
  w.z = in_plane;
  gl_Position = u_clip * vec4((w - u_eye) * 0.996, 1.0);
  gl_Position.z -= 15.0 * u_layer * gl_Position.w;      // over the layers of a town's ground
}
"""
)

SHADOW_FRAGMENT = """
#version 330
uniform float u_shade_left;
layout(location = 0) out vec4 o_colour;
void main() { o_colour = vec4(0.0, 0.0, 0.0, u_shade_left); }
"""

MARK_VERTEX = (
    COMMON
    + """
in vec2 in_corner;
in vec4 in_place;              // east, north, half length, heading (radians)
in vec2 in_kind;               // 0 ripple rings, 1 wake; strength
out vec2 v_at;
flat out vec2 v_kind;
flat out float v_size;
flat out vec2 v_seed;
void main() {
  v_at = in_corner;
  v_kind = in_kind;
  v_size = in_place.z;
  v_seed = floor(in_place.xy) / 7.0;
  vec2 q = in_corner * in_place.z;
  float s = sin(in_place.w), c = cos(in_place.w);
  vec3 w = vec3(in_place.xy + vec2(q.x * c + q.y * s, -q.x * s + q.y * c), u_level);
  gl_Position = u_clip * vec4((w - u_eye) * 0.997, 1.0);
}
"""
)

MARK_FRAGMENT = (
    COMMON
    + """
uniform sampler2D u_noise;
in vec2 v_at;
flat in vec2 v_kind;
flat in float v_size;
flat in vec2 v_seed;
layout(location = 0) out vec4 o_colour;
void main() {
  vec4 grain = texture(u_noise, (v_at * v_size) / 13.0 + v_seed + vec2(0.0, u_time * 0.02));
  float alpha;
  if (v_kind.x < 0.5) {
    float r = length(v_at);
    float rings = 0.5 + 0.5 * sin(22.0 * r - 3.0 * u_time + 3.0 * grain.r);
    alpha = smoothstep(1.0, 0.2, r) * (0.12 * rings + smoothstep(0.50, 0.75, grain.r + 0.35 * (0.5 - r)));
  } else {
    float back = (0.97 - v_at.y) * v_size;          // metres behind the bow
    float side = abs(v_at.x) * v_size;
    float age = back / (2.0 * v_size);
    float arms = smoothstep(0.35 + 0.05 * back, 0.0, abs(side - 0.5 - 0.30 * back)) * smoothstep(0.75, 0.1, age) * 0.7;
    float core = smoothstep(1.0 + 0.07 * back, 0.2, side) * smoothstep(6.5, 8.5, back) * smoothstep(1.0, 0.2, age);
    float froth = smoothstep(0.25 + 0.45 * age, 0.55 + 0.45 * age, grain.r * 0.6 + grain.b * 0.5);
    alpha = max(arms * smoothstep(0.42, 0.62, grain.r), core * froth);
  }
  o_colour = vec4(developed(vec3(0.62, 0.66, 0.67) * (0.55 * u_sunlight + u_skylight)).rgb, alpha * v_kind.y);
}
"""
)
