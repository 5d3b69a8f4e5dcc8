// Rain as faint streaks that the wind tilts; FLAKES: snow as soft specks.
#include "common.glsl"
uniform sampler2D u_noise;
uniform float u_rain;
uniform vec2 u_blow;           // velocity of the wind, m/s
layout(location = 0) out vec4 o_colour;
float layer_of(vec2 at, float cells, float fall) {   // at: bearing and height on a cylinder about the eye
  vec2 p = at * cells;
#ifdef FLAKES
  p += vec2(0.35 * sin(1.3 * u_time + floor(p.x)), u_time * fall);
  vec2 cell = floor(p), f = fract(p) - 0.5;
  vec4 n = textureLod(u_noise, (cell + 0.5) / 256.0, 0.0);
  vec4 m = textureLod(u_noise, (cell.yx + 77.5) / 256.0, 0.0);
  float off = length(f - 0.55 * (vec2(n.a, m.a) - 0.5));
  return smoothstep(0.16, 0.04, off) * step(1.0 - 0.7 * u_rain, fract(7.3 * n.a + 3.1 * m.a));
#else
  p.y = p.y * 0.10 + u_time * fall;
  float n = textureLod(u_noise, vec2(p.x / 256.0, p.y / 256.0), 0.0).a;
  float m = textureLod(u_noise, vec2(p.x / 256.0 + 0.37, p.y / 256.0 + 0.11), 0.0).a;
  return smoothstep(0.55, 1.0, n * m * 1.35);
#endif
}
void main() {
  vec3 d = normalize(ray_of(gl_FragCoord.xy));
  float flat_len = length(d.xy);
  vec2 at = vec2(atan(d.x, d.y), d.z / max(flat_len, 0.05));
  at.x -= at.y * 0.085 * dot(u_blow, vec2(d.y, -d.x) / max(flat_len, 0.05));   // rain falls at about 8 m/s
#ifdef FLAKES
  float s = 0.9 * layer_of(at, 26.0, 3.0) + 0.75 * layer_of(at + 0.31, 47.0, 4.2) + 0.6 * layer_of(at + 0.67, 90.0, 6.0);
  vec3 c = vec3(0.82, 0.84, 0.88) * (0.6 * u_sunlight + 1.4 * u_skylight);
  float alpha = 0.85 * min(s, 1.0);
#else
  float s = 0.5 * layer_of(at, 150.0, 34.0) + 0.35 * layer_of(at + 0.31, 290.0, 47.0) + 0.25 * layer_of(at + 0.67, 520.0, 60.0);
  vec3 c = (u_haze + vec3(0.05)) * 1.1;
  float alpha = (0.07 + 0.30 * s) * u_rain;
#endif
  o_colour = vec4(developed(c).rgb, alpha * smoothstep(0.02, 0.5, flat_len));
}
