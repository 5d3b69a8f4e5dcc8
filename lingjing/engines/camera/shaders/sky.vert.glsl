#include "common.glsl"
in vec2 in_corner;
noperspective out vec3 v_ray;
void main() {
  gl_Position = vec4(in_corner * 3.0, 1.0, 1.0);
  v_ray = ray_of(u_lens.xy * (1.0 + in_corner * 3.0));
}
