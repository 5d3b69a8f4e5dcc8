#include "common.glsl"
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
