#ifdef ALOFT
uniform sampler2D u_noise, u_clouds;
vec3 country(vec3 c, vec2 at) {   // woods, and fields of a few hundred metres: what tells country from lawn from orbit
  vec2 bent = at + 260.0 * (texture(u_noise, at / 9100.0).rg - 0.5);
  vec2 lot = mat2(0.94, 0.34, -0.34, 0.94) * bent / vec2(430.0, 270.0);
  lot.y += 0.5 * mod(floor(lot.x), 2.0);
  vec4 crop = textureLod(u_noise, (floor(lot) + 0.5) * vec2(0.137, 0.071), 0.0);
  vec3 field = mix(c, vec3(0.165, 0.150, 0.072), 0.75 * smoothstep(0.45, 0.75, crop.r));
  field = mix(field, vec3(0.070, 0.115, 0.034), 0.8 * smoothstep(0.5, 0.75, crop.g)) * (0.75 + 0.5 * crop.b);
  float wood = texture(u_clouds, at / 17000.0).r + 0.22 * (texture(u_noise, at / 2300.0).b - 0.5);
  wood += 0.3 * (texture(u_noise, at.yx / 83000.0).g - 0.5);
  vec3 seen = mix(field, vec3(0.034, 0.056, 0.020), 0.85 * smoothstep(0.50, 0.62, wood));
  vec2 step_m = fwidth(at);
  float blur = smoothstep(150.0, 900.0, max(step_m.x, step_m.y));   // where no pixel holds a field
  return mix(seen, 0.45 * c + vec3(0.016, 0.026, 0.010), blur);
}
#endif
#ifdef MAPPED
#ifdef ALOFT
#else
uniform sampler2D u_noise, u_clouds;
#endif
vec3 outland(vec2 at) {   // fields and woods around a town
  vec2 bent = at + 130.0 * (texture(u_noise, at / 3100.0).rg - 0.5);
  vec2 lot = mat2(0.94, 0.34, -0.34, 0.94) * bent / vec2(260.0, 170.0);
  lot.y += 0.5 * mod(floor(lot.x), 2.0);
  vec4 crop = textureLod(u_noise, (floor(lot) + 0.5) * vec2(0.137, 0.071), 0.0);
  vec3 field = mix(vec3(0.092, 0.126, 0.040), vec3(0.175, 0.155, 0.070), 0.75 * smoothstep(0.50, 0.72, crop.r));
  field = mix(field, vec3(0.066, 0.112, 0.032), 0.8 * smoothstep(0.5, 0.7, crop.g)) * (0.82 + 0.36 * crop.b);
  vec2 border = abs(fract(lot) - 0.5), w = fwidth(lot);
  field *= 1.0 - 0.35 * clamp((max(border.x, border.y) - 0.475) / max(w.x, w.y), 0.0, 1.0)
                      * clamp(1.0 - 8.0 * max(w.x, w.y), 0.0, 1.0);
  float wood = texture(u_clouds, at / 7000.0).r;
  return mix(field, vec3(0.036, 0.058, 0.022), 0.9 * smoothstep(0.48, 0.53, wood + 0.1 * (crop.b - 0.5)));
}
uniform sampler2D u_map;
uniform vec4 u_map_bounds;      // west, south, 1 / width, 1 / height
uniform vec2 u_map_range;       // from here on the map takes over, until there
#endif
