#include "city.glsl"
#include "city_map.glsl"
#define PATCH vec3(0.110, 0.130, 0.058)
void main() {
#include "city_pave.glsl"
#ifdef NIGHT
  vec3 glow = c * vec3(0.20, 0.15, 0.09);
#endif
#include "city_ground_end.glsl"
