#include "common.glsl"
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
