#include "common.glsl"
#include "outputs.glsl"
uniform sampler2D u_clouds, u_noise;
uniform float u_ridge;
noperspective in vec3 v_ray;
void main() {
  vec3 d = v_ray * inversesqrt(dot(v_ray, v_ray));
  float rise = max(d.z, 0.0), low = (1.0 - rise) * (1.0 - rise);
  float sunward = 0.5 + 0.5 * dot(d.xy, u_sun.xy);
  sunward *= sunward;
  vec3 c = u_sky_top + u_sky_rise * rise + (u_sky_low + u_dusk * (sunward - 0.35)) * low;
  float glow = max(dot(d, u_sun), 0.0), off = 1.0 - glow;
  // the sun's aureole and its disc: (1 - x / 8)^8 for e^-x, about what powers of 90 and 4000 are, and cheaper
  vec3 about = vec3(glow, max(1.0 - 11.25 * off, 0.0), max(1.0 - 500.0 * off, 0.0));
  about *= about; about *= about; about *= about;
  c += u_sunlight * (0.05 * about.x + (1.0 - u_cloud) * (0.25 * about.y + 8.0 * about.z));
  vec2 at = d.xy * (0.16 / (rise + 0.06)) + u_time * vec2(2e-5, 1e-5) * u_wind;
  float puff = 1.15 * texture(u_clouds, at).r;
  float veil = smoothstep(0.95 - 0.65 * u_cloud, 1.15 - 0.45 * u_cloud, puff + 0.12) * smoothstep(0.0, 0.12, rise);
  vec3 white = vec3(0.86, 0.87, 0.88) * (0.75 + 0.3 * glow) * (1.0 - 0.97 * u_dark) * u_gloom + u_dusk * 0.5;
  c = mix(c, white, veil * 0.8);
  c = mix(u_haze + u_dusk * (1.3 * sunward), c, (1.0 - exp2(-30.0 * rise)) * u_clear);
  float hills = 0.004 + 0.034 * texture(u_noise, d.xy * 0.21).r * texture(u_noise, d.yx * 0.55).g;   // 5 km away
  float hill = clamp((hills - rise) * 700.0, 0.0, 1.0) * u_ridge * exp2(-4200.0 * u_fog);
  c = mix(c, vec3(0.045, 0.065, 0.055) * (u_sunlight + u_skylight), hill);
  o_colour = developed(c);
  o_id = 0u;
  o_depth = uintBitsToFloat(0x7f800000u);
}
