// What every program of a picture knows: the camera, the light, the fog (Koschmieder: contrast falls to 2 % at the visibility).
// The picture is drawn upside down in GL terms (clip y is flipped), so that row 0 of a read-back is the top row and
// gl_FragCoord.xy is the pixel of `lingjing.plugins.geometry`. No time but u_time decides a pixel.
uniform mat4 u_clip;
uniform vec3 u_eye, u_right, u_down, u_axis;
uniform vec3 u_lens;          // half width, half height, focal length (pixels)
uniform vec3 u_sun, u_sunlight, u_skylight, u_haze;
uniform float u_fog, u_level, u_time, u_cloud, u_wind;
uniform float u_dark, u_gloom, u_clear;  // 0 day … 1 night; what rain leaves of the sky's light, fog of its sight
uniform vec3 u_dusk;          // glow over the horizon, low sun
uniform vec3 u_sky_top, u_sky_rise, u_sky_low;  // the sky: at any height, more of it higher up, more of it lower down

vec3 ray_of(vec2 pixel) {
  return u_axis + ((pixel.x - u_lens.x) * u_right + (pixel.y - u_lens.y) * u_down) / u_lens.z;
}
vec3 sky_of(vec3 d) {
  float h = clamp(d.z, 0.0, 1.0), low = (1.0 - h) * (1.0 - h);
  return u_sky_top + u_sky_rise * h + (u_sky_low + u_dusk * (0.5 * dot(d.xy, u_sun.xy))) * low;
}
vec3 fogged(vec3 c, float range, float dive) {   // dive: 0 level line of sight, 1 straight down (less airlight)
  return mix(u_haze * (1.0 - 0.6 * dive), c, exp2(-u_fog * range));
}
#ifdef SHADED
uniform mat4 u_shade;         // world → shadow map (0..1, depth along the sun's rays)
uniform sampler2DShadow u_shadow;
uniform float u_shade_step;   // metres that a surface is lifted before it is looked up: else it shades itself
float sunlit(vec3 w, vec3 n) {
  vec3 s = (u_shade * vec4(w + (n + 0.8 * u_sun) * u_shade_step, 1.0)).xyz;
  vec2 edge = abs(s.xy - 0.5);
  return max(texture(u_shadow, s), step(0.498, max(edge.x, edge.y)));
}
#else
float sunlit(vec3 w, vec3 n) { return 1.0; }
#endif
vec4 developed(vec3 c) {
  // v = sqrt(1 - e^-1.9c), 0.55 of the way to v^2 (3 - 2v), less than a 400th off: `uniforms.haze` says it in full
  vec3 s = sqrt(clamp(c, 0.0, 2.25));
  return vec4(s * (0.59784 + s * (3.72097 + s * (-6.43773 + s * (3.90812 - s * 0.83342)))), 1.0);
}
