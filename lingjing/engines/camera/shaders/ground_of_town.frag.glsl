#include "city.glsl"
#include "city_map.glsl"
#define PATCH vec3(0.110, 0.130, 0.058)
void main() {
#include "city_pave.glsl"
#ifdef MAPPED
  c = mix(c, outland(v_world.xy), max(out_of.x, out_of.y));
#endif
#ifdef NIGHT
  vec3 glow = c * vec3(0.10, 0.08, 0.05);
#endif
#include "city_ground_end.glsl"
