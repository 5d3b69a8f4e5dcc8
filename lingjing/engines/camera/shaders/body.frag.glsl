// The solid part of flames and spray: id and depth. Its colour comes from soft sprites (`cloud.frag`).
#include "common.glsl"
#include "outputs.glsl"
#include "billboard.glsl"
void main() {
  if (within(grain()) < 0.12) discard;
  o_colour = vec4(0.0);
  o_id = v_id;
  o_depth = dot(v_world - u_eye, u_axis);
}
