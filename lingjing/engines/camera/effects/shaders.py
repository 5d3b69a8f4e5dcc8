"""GLSL of effects: billboards as bodies (opaque, with id and depth) or clouds (blended), and flat decals."""

from __future__ import annotations

from lingjing.engines.camera.shaders import COMMON, OUTPUTS

BILLBOARD_VERTEX = (
    COMMON
    + """
in vec2 in_corner;
in vec3 in_place, in_axis;
in float in_size;
in vec4 in_paint;              // colour, opacity
in vec4 in_style;              // softness, glow, shape, seed
in uint in_id;
out vec3 v_world;
out vec2 v_at;                 // in half widths
flat out float v_long;
flat out vec4 v_paint, v_style;
flat out uint v_id;
void main() {
  vec3 ray = normalize(in_place - u_eye);
  vec3 seen = in_axis - dot(in_axis, ray) * ray;
  float half_long = length(seen);
  vec3 upright = -u_down - dot(-u_down, ray) * ray;
  vec3 along = half_long > 0.02 * in_size ? seen / half_long : normalize(upright);
  vec3 across = cross(ray, along);
  v_long = half_long / in_size;
  v_at = in_corner * vec2(1.0, 1.0 + v_long);
  v_world = in_place + in_size * (across * v_at.x + along * v_at.y);
  v_paint = in_paint;
  v_style = in_style;
  v_id = in_id;
  gl_Position = u_clip * vec4(v_world - u_eye, 1.0);
}
"""
)

BILLBOARD_SHAPE = """
uniform sampler2D u_noise;
in vec3 v_world;
in vec2 v_at;
flat in float v_long;
flat in vec4 v_paint, v_style;
flat in uint v_id;
vec4 grain() { return texture(u_noise, v_at * 0.13 + vec2(v_style.w * 0.371, v_style.w * 0.713)); }
float within(vec4 n) {                  // 0 at the edge, 1 in the middle, less where the noise bites
  float rise = 0.5 + 0.5 * v_at.y / (1.0 + v_long);
  float narrow = mix(1.0, sqrt(max(1.0 - rise, 0.0)) * (0.55 + 0.45 * smoothstep(0.0, 0.3, rise)), min(v_long, 1.0));
  bool flame = v_style.z > 0.5 && v_style.z < 1.5;
  float d = flame ? length(vec2(v_at.x / max(narrow, 0.05), max(abs(v_at.y) - v_long, 0.0)))
                  : length(vec2(v_at.x, max(abs(v_at.y) - v_long, 0.0)));
  float bite = v_style.z > 1.5 ? 0.15 : (flame ? 0.9 : 1.1);
  return 1.0 - d * (1.0 + bite * (n.r * 0.6 + n.g * 0.4 - 0.25));
}
vec3 painted(float inside, vec4 n) {
  vec3 light = v_style.y > 0.5 ? vec3(1.0) : 0.42 * u_sunlight + 0.85 * u_skylight;
  float rise = 0.5 + 0.5 * v_at.y / (1.0 + v_long);
  vec3 c = v_paint.rgb;
  if (v_style.z > 0.5 && v_style.z < 1.5) {
    float heat = clamp(inside * 1.35 + 0.25 * n.g - 0.55 * rise * min(v_long, 1.0), 0.0, 1.0);
    c *= mix(vec3(0.92, 0.22, 0.08), vec3(1.0), heat);
  } else if (v_style.y < 0.5) {         // lit from the sun's side, curdled
    vec2 sun = vec2(dot(u_sun, u_right), -dot(u_sun, u_down));
    c *= (0.80 + 0.45 * dot(v_at, sun) / (1.0 + v_long)) * (0.55 + 0.9 * n.g);
  }
  return c * light;
}
"""

BODY_FRAGMENT = (
    COMMON
    + OUTPUTS
    + BILLBOARD_SHAPE
    + """
void main() {
  vec4 n = grain();
  float inside = within(n);
  if (inside < 0.12) discard;
  vec3 to_eye = u_eye - v_world;
  float range = length(to_eye);
  o_colour = developed(fogged(painted(inside, n), range, max(to_eye.z / range, 0.0)));
  o_id = v_id;
  o_depth = -dot(to_eye, u_axis);
}
"""
)

CLOUD_FRAGMENT = (
    COMMON
    + BILLBOARD_SHAPE
    + """
layout(location = 0) out vec4 o_colour;
void main() {
  vec4 n = grain();
  float inside = within(n);
  float alpha = v_paint.a * smoothstep(0.0, max(v_style.x, 0.02), inside);
  if (alpha < 0.004) discard;
  vec3 to_eye = u_eye - v_world;
  float range = length(to_eye);
  alpha *= smoothstep(0.3, 1.5, range);
  o_colour = vec4(developed(fogged(painted(inside, n), range, max(to_eye.z / range, 0.0))).rgb, alpha);
}
"""
)

DECAL_VERTEX = (
    COMMON
    + """
uniform float u_layer;
in vec2 in_corner;
in vec3 in_place;
in vec3 in_lie;                // half extents right and ahead, heading
in vec4 in_paint;
in vec2 in_style;              // kind, seed
out vec3 v_world;
out vec2 v_at;
flat out vec4 v_paint;
flat out vec2 v_style, v_half;
void main() {
  v_at = in_corner;
  v_half = in_lie.xy;
  v_paint = in_paint;
  v_style = in_style;
  vec2 q = in_corner * in_lie.xy;
  float s = sin(in_lie.z), c = cos(in_lie.z);
  v_world = in_place + vec3(q.x * c + q.y * s, -q.x * s + q.y * c, 0.02);
  gl_Position = u_clip * vec4((v_world - u_eye) * 0.997, 1.0);
  gl_Position.z -= 14.0 * u_layer * gl_Position.w;      // over the layers of a town's ground
}
"""
)

DECAL_FRAGMENT = (
    COMMON
    + """
uniform sampler2D u_noise;
uniform float u_lift;          // of light on the ground: how much of it
in vec3 v_world;
in vec2 v_at;
flat in vec4 v_paint;
flat in vec2 v_style, v_half;
layout(location = 0) out vec4 o_colour;
float shining() {                     // light on the ground: a round pool, or a cone from its near end
  if (v_style.x < 3.5) {
    float left = max(1.0 - dot(v_at, v_at), 0.0);
    return left * left / (1.0 + 3.0 * dot(v_at, v_at));
  }
  float far = 0.5 + 0.5 * v_at.y, across = v_at.x / mix(0.42, 1.0, far);
  float left = max(1.0 - across * across, 0.0) * (1.0 - far);
  return left * left * smoothstep(0.0, 0.12, far) * 1.2;
}
void main() {
  if (v_style.x > 2.5) {
    float seen = exp2(-u_fog * length(u_eye - v_world));
    o_colour = vec4(v_paint.rgb * min(v_paint.a * shining(), 1.0) * u_lift * seen, 1.0);
    return;
  }
  vec4 n = texture(u_noise, v_at * v_half * 0.03 + v_style.y * vec2(0.37, 0.71));
  float inside = v_style.x > 1.5 ? 1.0 : 1.0 - length(v_at) * (1.0 + 1.3 * (n.r * 0.65 + n.g * 0.35));
  float alpha = v_paint.a * smoothstep(0.0, 0.18, inside);
  if (alpha < 0.004) discard;
  vec3 to_eye = u_eye - v_world;
  float range = length(to_eye);
  vec3 v = to_eye / range;
  vec3 c = v_paint.rgb * (u_sunlight * u_sun.z + u_skylight);
  if (v_style.x > 0.5 && v_style.x < 1.5) {
    float f = 1.0 - max(v.z, 0.0);
    vec3 h = normalize(v + u_sun);
    float glint = pow(max(h.z + 0.02 * (n.b - 0.5), 0.0), 220.0) * 1.2;
    c += sky_of(reflect(-v, vec3(0.0, 0.0, 1.0))) * (0.03 + 0.75 * f * f * f * f) + u_sunlight * glint;
  }
  o_colour = vec4(developed(fogged(c, range, max(v.z, 0.0))).rgb, alpha);
}
"""
)
