// Soft sprites: smoke, flames, spray, mist and glow. They are blended, without id and depth. The output is what they
// add to the picture, and in alpha the share of the background that they hide.
#include "common.glsl"
#include "billboard.glsl"
layout(location = 0) out vec4 o_colour;
vec4 flame(float fade) {                // tongues that the noise tears, brighter where they overlap
  float rise = rise_of(), upright = min(v_long, 1.0);
  vec2 flow = vec2(0.0, u_time * (0.55 + 0.25 * fract(v_style.w * 0.37)));
  vec4 wide = texture(u_noise, v_at * vec2(0.055, 0.045) + v_style.w * SCATTER - 0.35 * flow);
  vec4 fine = texture(u_noise, v_at * vec2(0.16, 0.10) + v_style.w * SCATTER.yx - flow);
  float x = v_at.x + upright * rise * 1.3 * (wide.r - 0.5) + 0.35 * (fine.g - 0.5);
  float taper = mix(1.0, sqrt(max(1.0 - rise, 0.0)) * (0.5 + 0.5 * smoothstep(0.0, 0.25, rise)), upright);
  float d = length(vec2(x / max(taper, 0.06), max(abs(v_at.y) - v_long, 0.0)));
  float body = 1.0 - d - (0.25 + 0.65 * rise * upright) * (1.35 * fine.r + 0.65 * wide.g - 0.75);
  float rim = min(1.0 - abs(v_at.x), 1.0 + v_long - abs(v_at.y));
  float dense = smoothstep(0.0, 0.55, body) * smoothstep(0.0, 0.35, rim);
  float heat = clamp(1.2 * body + 0.30 - 0.55 * rise * upright, 0.0, 1.0);
  vec3 c = mix(vec3(0.50, 0.050, 0.004), v_paint.rgb * vec3(1.05, 0.85, 0.6), heat);
  c += vec3(0.20, 0.30, 0.13) * smoothstep(0.60, 1.0, heat);
  float shown = v_paint.a * dense * fade;
  return vec4(c * 0.85 * shown, 0.62 * shown);
}
void main() {
  vec3 to_eye = u_eye - v_world;
  float range = length(to_eye);
  float fade = smoothstep(0.3, 1.5, range);
  if (is_flame()) {
    vec4 lit = flame(fade);
    if (lit.a < 0.004) discard;
    o_colour = lit * mix(0.35, 1.0, exp2(-u_fog * range));
    return;
  }
  vec4 n = grain();
  float inside = within(n);
  float alpha = v_paint.a * smoothstep(0.0, max(v_style.x, 0.02), inside) * fade;
  if (alpha < 0.004) discard;
  vec3 c = v_paint.rgb;
  if (v_style.y < 0.5) {                // a ball of vapour, curdled, lit by sun and sky
    vec4 curl = texture(u_noise, v_at * 0.41 - v_style.w * SCATTER.yx);
    vec2 flat_at = v_at / (1.0 + vec2(0.0, v_long)) + 1.1 * (vec2(n.g, curl.r) - 0.5);
    float bulge = sqrt(max(1.0 - dot(flat_at, flat_at), 0.05));
    vec3 normal = normalize(flat_at.x * u_right - flat_at.y * u_down - bulge * u_axis);
    float sun = max(0.35 + 0.65 * dot(normal, u_sun), 0.0);
    c *= (0.78 * sun * u_sunlight + (0.62 + 0.38 * normal.z) * u_skylight) * (0.35 + 0.75 * n.g + 0.75 * curl.g);
  }
  o_colour = vec4(developed(fogged(c, range, max(to_eye.z / range, 0.0))).rgb * alpha, alpha);
}
