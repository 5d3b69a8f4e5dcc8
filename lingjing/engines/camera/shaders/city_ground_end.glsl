#include "city_ray.glsl"
#ifdef WET
  float f = 1.0 - v.z;
  float paved = smoothstep(1.25, 1.05, v_colour.g / v_colour.r);
  float puddle = (0.22 + 0.55 * smoothstep(0.62, 0.80, asphalt)) * mix(0.12, 1.0, paved);
  c *= 0.60;
#endif
  c *= v_sunned * sunny() + u_skylight;
#ifdef WET
  c += sky_of(vec3(-v.xy, v.z)) * (0.03 + 0.80 * f * f * f * f * f) * puddle;
#endif
#ifdef NIGHT
  c += glow * u_dark;
#endif
#include "city_end.glsl"
