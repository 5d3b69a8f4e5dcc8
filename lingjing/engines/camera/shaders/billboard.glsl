uniform sampler2D u_noise;
in vec3 v_world;
in vec2 v_at;
flat in float v_long;
flat in vec4 v_paint, v_style;
flat in uint v_id;
vec4 grain() { return texture(u_noise, v_at * 0.13 + vec2(v_style.w * 0.371, v_style.w * 0.713)); }
float within(vec4 n) {                  // 0 at the edge, 1 in the middle, less where the noise bites
  float rise = 0.5 + 0.5 * v_at.y / (1.0 + v_long);
  float narrow = mix(1.0, sqrt(max(1.0 - rise, 0.0)) * (0.55 + 0.45 * smoothstep(0.0, 0.3, rise)), min(v_long, 1.0));
  bool flame = v_style.z > 0.5 && v_style.z < 1.5;
  float d = flame ? length(vec2(v_at.x / max(narrow, 0.05), max(abs(v_at.y) - v_long, 0.0)))
                  : length(vec2(v_at.x, max(abs(v_at.y) - v_long, 0.0)));
  float bite = v_style.z > 1.5 ? 0.15 : (flame ? 0.9 : 1.1);
  return 1.0 - d * (1.0 + bite * (n.r * 0.6 + n.g * 0.4 - 0.25));
}
vec3 painted(float inside, vec4 n) {
  vec3 light = v_style.y > 0.5 ? vec3(1.0) : 0.42 * u_sunlight + 0.85 * u_skylight;
  float rise = 0.5 + 0.5 * v_at.y / (1.0 + v_long);
  vec3 c = v_paint.rgb;
  if (v_style.z > 0.5 && v_style.z < 1.5) {
    float heat = clamp(inside * 1.35 + 0.25 * n.g - 0.55 * rise * min(v_long, 1.0), 0.0, 1.0);
    c *= mix(vec3(0.92, 0.22, 0.08), vec3(1.0), heat);
  } else if (v_style.y < 0.5) {         // lit from the sun's side, curdled
    vec2 sun = vec2(dot(u_sun, u_right), -dot(u_sun, u_down));
    c *= (0.80 + 0.45 * dot(v_at, sun) / (1.0 + v_long)) * (0.55 + 0.9 * n.g);
  }
  return c * light;
}
