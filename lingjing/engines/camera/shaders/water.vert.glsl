#include "common.glsl"
in vec2 in_corner;
void main() {
  gl_Position = u_clip * vec4(in_corner * 30000.0, u_level - u_eye.z, 1.0);
}
