#include "common.glsl"
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
