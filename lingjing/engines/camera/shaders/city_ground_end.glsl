#include "city_ray.glsl"
#ifdef WET
  float f = 1.0 - v.z;
  float paved = smoothstep(1.25, 1.05, v_colour.g / v_colour.r);
  float patchy = mix(smoothstep(0.50, 0.80, asphalt), 0.45, clamp(range * 0.025, 0.0, 1.0));
  float puddle = (0.30 + 0.30 * patchy) * mix(0.12, 1.0, paved) * (1.0 - u_snow) * step(0.001, u_rain);
  c *= mix(0.60, 0.85, u_snow);
  float cover = smoothstep(1.05 - 1.1 * u_snow, 1.35 - 1.1 * u_snow, asphalt + 0.25 * float(paved < 0.5));
  c = mix(c, vec3(0.70, 0.73, 0.78), 0.92 * cover);
#endif
  c *= v_sunned * sunny() + u_skylight;
#ifdef WET
  c += sky_of(vec3(-v.xy, v.z)) * (0.03 + 0.80 * f * f * f * f * f) * puddle;
#endif
#ifdef NIGHT
  c += glow * u_dark;
#endif
#include "city_end.glsl"
