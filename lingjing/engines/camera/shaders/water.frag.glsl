#include "common.glsl"
#include "outputs.glsl"
uniform sampler2D u_swell, u_ripple, u_shore;
uniform vec2 u_swell_scale, u_ripple_scale;   // metres and slope of a full deflection
uniform vec2 u_lengths;                       // patch lengths
uniform vec4 u_bounds;                        // west, south, 1 / width, 1 / height
uniform float u_reach;
uniform float u_silt;                         // 0 the sea … 1 a slow river
void main() {
  vec3 ray = ray_of(gl_FragCoord.xy);
  float depth = (u_level - u_eye.z) / ray.z;
  vec3 p = u_eye + depth * ray;
  float range = depth * length(ray);
  vec3 v = -ray * (depth / range);

  vec4 a = texture(u_swell, p.xy / u_lengths.x);
  vec4 b = texture(u_ripple, p.xy / u_lengths.y);
  vec4 c = texture(u_ripple, mat2(0.8, 0.6, -0.6, 0.8) * p.xy / (u_lengths.y * 3.3));
  vec2 shore = texture(u_shore, (p.xy - u_bounds.xy) * u_bounds.zw).rg;
#ifdef ALOFT
  vec2 aside = smoothstep(0.40, 0.49, abs((p.xy - u_bounds.xy) * u_bounds.zw - 0.5));
  shore = mix(shore, vec2(1.0, 0.5), max(aside.x, aside.y));
#endif
  float land = shore.r * shore.r * u_reach;
  float gust = 0.55 + 0.9 * shore.g;
  vec2 slope = (a.yz * 2.0 - 1.0) * u_swell_scale.y
             + (b.yz * 2.0 - 1.0) * u_ripple_scale.y * gust
             + (c.yz * 2.0 - 1.0) * u_ripple_scale.y * 0.8 * gust;
  slope *= 0.35 + 0.65 * smoothstep(0.0, 40.0, land);
  vec3 n = normalize(vec3(-slope, 1.0));

  float facing = max(dot(n, v), 0.0);
  float f = 1.0 - facing;
  float fresnel = 0.022 + 0.978 * f * f * f * f * f;
  vec3 r = reflect(-v, n);
  r.z = abs(r.z);

  float height = (a.x * 2.0 - 1.0) * u_swell_scale.x;
  float near = 1.0 - shore.r;
  float shoal = near * near * near;
  vec3 body = mix(vec3(0.008, 0.052, 0.072), vec3(0.016, 0.074, 0.086), shore.g);
  body = mix(body, vec3(0.055, 0.215, 0.20), shoal * (0.55 + 0.45 * near));
  body = mix(body, vec3(0.27, 0.29, 0.20), shoal * shoal * shoal);
  body = mix(body, vec3(0.088, 0.105, 0.078) * (0.8 + 0.4 * shore.g), 0.85 * u_silt);
  float lit = 0.55 + 0.45 * max(dot(n, u_sun), 0.0) / max(u_sun.z, 0.2);
  body *= lit * (1.0 + 0.35 * clamp(height, -1.0, 1.6) + 1.6 * dot(slope, -u_sun.xy));
  vec3 colour = body * (0.35 * u_sunlight + u_skylight) + sky_of(r) * fresnel * 1.15;

  vec3 h = normalize(v + u_sun);
  float sharp = mix(900.0, 90.0, clamp(range / 900.0, 0.0, 1.0));
  float glint = pow(max(dot(n, h), 0.0), sharp) * (sharp + 8.0) * 0.0125;
  colour += u_sunlight * min(glint * (0.02 + fresnel * 1.5), 3.0);

  float lace = b.a * 0.75 + c.a * 0.30 + (b.x - 0.5) * 0.3;
  float foam = a.w * smoothstep(0.78 - 0.28 * a.w, 1.06 - 0.28 * a.w, lace);
  float swash = land - 1.6 + 0.8 * sin(u_time * 0.7 + c.a * 9.0) + 4.0 * (shore.g + c.a - 1.0) + 1.2 * height;
  float surf = smoothstep(0.50, 0.80, lace + 0.16 * smoothstep(1.5, -1.0, swash));
  foam = max(foam, 0.85 * smoothstep(2.6, -0.4, swash) * surf * (1.0 - u_silt));
  colour = mix(colour, vec3(0.62, 0.66, 0.67) * (0.55 * u_sunlight + u_skylight), foam);

  o_colour = developed(fogged(colour, range, v.z));
  o_id = 1u;
  o_depth = depth;
}
