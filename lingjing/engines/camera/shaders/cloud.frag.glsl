// Billboards as clouds: blended, without id and depth.
#include "common.glsl"
#include "billboard.glsl"
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
