// Soil, and with JOINTED pavings in slabs.
#include "city.glsl"
#include "city_map.glsl"
#define PATCH vec3(0.125, 0.135, 0.060)
void main() {
#include "city_pave.glsl"
#ifdef NIGHT
  vec3 glow = c * vec3(0.17, 0.13, 0.08);
#endif
#include "city_ground_end.glsl"
