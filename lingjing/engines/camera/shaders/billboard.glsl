uniform sampler2D u_noise;
in vec3 v_world;
in vec2 v_at;
flat in float v_long;
flat in vec4 v_paint, v_style;
flat in uint v_id;
const vec2 SCATTER = vec2(0.371, 0.713);
bool is_flame() { return v_style.z > 0.5 && v_style.z < 1.5; }
float rise_of() { return 0.5 + 0.5 * v_at.y / (1.0 + v_long); }
vec4 grain() { return texture(u_noise, v_at * 0.13 + v_style.w * SCATTER); }
float within(vec4 n) {                  // 0 at the edge, 1 in the middle, less where the noise bites
  float rise = rise_of();
  float narrow = mix(1.0, sqrt(max(1.0 - rise, 0.0)) * (0.55 + 0.45 * smoothstep(0.0, 0.3, rise)), min(v_long, 1.0));
  float d = is_flame() ? length(vec2(v_at.x / max(narrow, 0.05), max(abs(v_at.y) - v_long, 0.0)))
                       : length(vec2(v_at.x, max(abs(v_at.y) - v_long, 0.0)));
  float bite = v_style.z > 1.5 ? 0.15 : (is_flame() ? 0.9 : 1.1);
  return 1.0 - d * (1.0 + bite * (n.r * 0.6 + n.g * 0.4 - 0.25));
}
