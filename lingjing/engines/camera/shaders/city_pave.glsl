#ifdef WET
  vec3 grain = texture(u_grain, v_world.xy / GRAIN_M).rgb;
  float asphalt = grain.b;
#else
  vec2 grain = texture(u_paved, v_world.xy / GRAIN_M).rg;
#endif
  vec3 c = v_colour.rgb * (1.0 + v_style.z * (grain.r * 2.0 - 1.0));
  c = mix(c, PATCH, grain.g * v_style.w);
#ifdef ALOFT
  c = country(c, v_world.xy);
#endif
#ifdef JOINTED
  float spacing = 1.0 / v_style.x;
  vec2 joint = abs(fract(v_world.xy * spacing) - 0.5);
  vec2 w = fwidth(v_world.xy) * spacing;
  vec2 seam = clamp((joint - 0.485) / w + 0.5, 0.0, 1.0) * clamp(1.0 - 2.0 * w, 0.0, 1.0);
  c *= 1.0 - v_style.y * max(seam.x, seam.y);
#endif

#ifdef MAPPED
  vec2 uv = (v_world.xy - u_map_bounds.xy) * u_map_bounds.zw;
  vec3 mapped = texture(u_map, uv).rgb;
  mapped *= mapped;
  vec2 out_of = step(0.5, abs(uv - 0.5));
  float away = length(u_eye - v_world);
  c = mix(c, mapped, smoothstep(u_map_range.x, u_map_range.y, away) * (1.0 - max(out_of.x, out_of.y)));
#endif
