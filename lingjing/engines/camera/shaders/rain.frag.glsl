#include "common.glsl"
uniform sampler2D u_noise;
uniform float u_rain;
layout(location = 0) out vec4 o_colour;
float streaks(vec3 d, float scale, float speed) {
  // drops on a cylinder about the eye: across is the bearing, along the height on it; straight up and down they fade
  float flat_len = length(d.xy);
  float turn = atan(d.x, d.y) * scale * 3.0;
  float rise = d.z / max(flat_len, 0.05) * scale * 0.22 + u_time * speed;
  float n = textureLod(u_noise, vec2(turn * 0.31, rise * 0.045), 0.0).a;
  return smoothstep(0.80, 0.97, n) * smoothstep(0.02, 0.5, flat_len);
}
void main() {
  vec3 d = normalize(ray_of(gl_FragCoord.xy));
  float s = 0.6 * streaks(d, 3.0, 0.91) + 0.4 * streaks(d, 5.7, 0.67);
  vec3 c = (u_haze + vec3(0.05)) * 1.15;
  o_colour = vec4(developed(c).rgb, s * 0.38 * u_rain);
}
