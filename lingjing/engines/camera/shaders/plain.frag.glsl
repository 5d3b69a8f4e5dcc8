#include "city.glsl"
void main() {
  vec3 n = v_normal;
#include "city_ray.glsl"
#ifdef EVEN
  float grain = MEAN_GRAIN;
#else
  float grain = texture(u_tone, v_world.xy * (2.0 / GRAIN_M) + v_world.z * 0.031).r;
#endif
  vec3 c = v_colour.rgb * (0.78 + 0.40 * grain);
#ifdef WET
  c *= mix(0.72, 0.9, u_snow);
  c = mix(c, vec3(0.70, 0.73, 0.78), 0.92 * smoothstep(0.25, 0.7, n.z) * smoothstep(0.0, 0.5, u_snow));
#endif
  c *= v_sunned * sunny() + u_skylight * (0.62 + 0.38 * n.z);
#ifdef WET
  float f = 1.0 - max(dot(n, v), 0.0);
  c += sky_of(reflect(-v, n)) * max(n.z, 0.0) * (1.0 - u_snow) * (0.03 + 0.4 * f * f * f);
#endif
#include "city_end.glsl"
