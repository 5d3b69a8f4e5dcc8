#include "common.glsl"
uniform sampler2D u_noise;
uniform float u_lift;          // of light on the ground: how much of it
in vec3 v_world;
in vec2 v_at;
flat in vec4 v_paint;
flat in vec2 v_style, v_half;
layout(location = 0) out vec4 o_colour;
float shining() {                     // light on the ground: a round pool, or a cone from its near end
  if (v_style.x < 3.5) {
    float left = max(1.0 - dot(v_at, v_at), 0.0);
    return left * left / (1.0 + 3.0 * dot(v_at, v_at));
  }
  float far = 0.5 + 0.5 * v_at.y, across = v_at.x / mix(0.42, 1.0, far);
  float left = max(1.0 - across * across, 0.0) * (1.0 - far);
  return left * left * smoothstep(0.0, 0.12, far) * 1.2;
}
void main() {
  if (v_style.x > 2.5) {
    float seen = exp2(-u_fog * length(u_eye - v_world));
    o_colour = vec4(v_paint.rgb * min(v_paint.a * shining(), 1.0) * u_lift * seen, 1.0);
    return;
  }
  vec4 n = texture(u_noise, v_at * v_half * 0.03 + v_style.y * vec2(0.37, 0.71));
  float inside = v_style.x > 1.5 ? 1.0 : 1.0 - length(v_at) * (1.0 + 1.3 * (n.r * 0.65 + n.g * 0.35));
  float alpha = v_paint.a * smoothstep(0.0, 0.18, inside);
  if (alpha < 0.004) discard;
  vec3 to_eye = u_eye - v_world;
  float range = length(to_eye);
  vec3 v = to_eye / range;
  vec3 c = v_paint.rgb * (u_sunlight * u_sun.z + u_skylight);
  if (v_style.x > 0.5 && v_style.x < 1.5) {
    float f = 1.0 - max(v.z, 0.0);
    vec3 h = normalize(v + u_sun);
    float glint = pow(max(h.z + 0.02 * (n.b - 0.5), 0.0), 220.0) * 1.2;
    c += sky_of(reflect(-v, vec3(0.0, 0.0, 1.0))) * (0.03 + 0.75 * f * f * f * f) + u_sunlight * glint;
  }
  o_colour = vec4(developed(fogged(c, range, max(v.z, 0.0))).rgb, alpha);
}
