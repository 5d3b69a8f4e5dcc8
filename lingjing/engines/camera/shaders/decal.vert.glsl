#include "common.glsl"
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
