// Billboards as bodies: opaque, with id and depth.
#include "common.glsl"
#include "outputs.glsl"
#include "billboard.glsl"
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
