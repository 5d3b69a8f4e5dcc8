#include "city.glsl"
flat in vec4 v_left, v_right, v_ends;
void main() {
  float past = v_at.y, left_over = v_style.y - v_at.y, half_wide = v_style.x;
  vec2 w = fwidth(v_at) + 1e-4, sharpness = 1.0 / w;
  float aside = half_wide - abs(v_at.x);
  vec4 lines = v_at.x > 0.0 ? v_left : v_right;
  vec4 low = vec4(aside - 0.12, past - 0.8, left_over - 0.8, left_over - 4.8) * sharpness.xyyy;
  vec4 high = vec4(0.27 - aside, 3.8 - past, 3.8 - left_over, 5.2 - left_over) * sharpness.xyyy;
  vec4 band = clamp(min(low, high) + 0.5, 0.0, 1.0) * clamp(vec4(0.15, 3.0, 3.0, 0.4) * sharpness.xyyy, 0.0, 1.0);
  float dash = abs(mod(past, 9.0) - 4.5);
  dash = mix(clamp((dash - 3.0) * sharpness.y + 0.5, 0.0, 1.0), 0.333, clamp(0.25 * w.y - 0.5, 0.0, 1.0));
  dash *= clamp((0.075 - aside) * sharpness.x + 0.5, 0.0, 1.0) * clamp(0.15 * sharpness.x, 0.0, 1.0);
  float clear = 1.0 - max(float(past < 5.0) * v_ends.x, float(left_over < 5.2) * v_ends.y);
  float bars = mix(clamp((0.228 - 0.95 * abs(fract(v_at.x / 0.95) - 0.5)) * sharpness.x + 0.5, 0.0, 1.0), 0.48,
                   clamp(1.7 * w.x - 0.7, 0.0, 1.0));
  float white = (lines.x * band.x + lines.y * dash) * clear + v_ends.z * band.w
              + bars * (v_ends.x * band.y + v_ends.y * band.z);
  float yellow = lines.z * band.x * clear;

  vec2 grain = texture(u_street, v_world.xy / GRAIN_M).rg;
  float asphalt = grain.r;
  float track = abs(abs(v_at.x) - 0.85);
  vec3 c = v_colour.rgb * (0.66 + 0.66 * asphalt);
  c *= 1.0 - 0.16 * clamp(1.25 - 2.5 * track, 0.0, 1.0) * float(half_wide > 0.1);
  float worn = 0.55 + 0.45 * grain.g;
  c = mix(c, vec3(0.62, 0.62, 0.60), clamp(white, 0.0, 1.0) * worn);
  c = mix(c, vec3(0.62, 0.42, 0.06), yellow * worn);
#ifdef NIGHT
  vec3 glow = c * vec3(0.20, 0.15, 0.09);
#endif
#include "city_ground_end.glsl"
