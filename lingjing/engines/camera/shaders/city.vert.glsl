#include "common.glsl"
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
  v_shade = (u_shade * vec4(in_position + (n + 0.8 * u_sun) * u_shade_step, 1.0)).xyz;
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
