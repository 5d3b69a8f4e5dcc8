#include "common.glsl"
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
