#include "common.glsl"
uniform sampler2D u_noise;
in vec2 v_at;
flat in vec2 v_kind;
flat in float v_size;
flat in vec2 v_seed;
layout(location = 0) out vec4 o_colour;
void main() {
  vec4 grain = texture(u_noise, (v_at * v_size) / 13.0 + v_seed + vec2(0.0, u_time * 0.02));
  float alpha;
  if (v_kind.x < 0.5) {
    float r = length(v_at);
    float rings = 0.5 + 0.5 * sin(22.0 * r - 3.0 * u_time + 3.0 * grain.r);
    alpha = smoothstep(1.0, 0.2, r) * (0.12 * rings + smoothstep(0.50, 0.75, grain.r + 0.35 * (0.5 - r)));
  } else {
    float back = (0.97 - v_at.y) * v_size;          // metres behind the bow
    float side = abs(v_at.x) * v_size;
    float age = back / (2.0 * v_size);
    float arms = smoothstep(0.35 + 0.05 * back, 0.0, abs(side - 0.5 - 0.30 * back)) * smoothstep(0.75, 0.1, age) * 0.7;
    float core = smoothstep(1.0 + 0.07 * back, 0.2, side) * smoothstep(6.5, 8.5, back) * smoothstep(1.0, 0.2, age);
    float froth = smoothstep(0.25 + 0.45 * age, 0.55 + 0.45 * age, grain.r * 0.6 + grain.b * 0.5);
    alpha = max(arms * smoothstep(0.42, 0.62, grain.r), core * froth);
  }
  o_colour = vec4(developed(vec3(0.62, 0.66, 0.67) * (0.55 * u_sunlight + u_skylight)).rgb, alpha * v_kind.y);
}
