#include "common.glsl"
#include "outputs.glsl"
#ifdef DULL
uniform sampler2D u_noise;
#endif
in vec3 v_world, v_normal;
in vec4 v_colour;
flat in uint v_id;
void main() {
  vec3 to_eye = u_eye - v_world;
  float range = length(to_eye);
  vec3 v = to_eye / range;
  vec3 n = normalize(v_normal);
  n = dot(n, v) < 0.0 ? -n : n;
  vec3 sun = u_sunlight * sunlit(v_world, n);
  vec3 light = sun * max(dot(n, u_sun), 0.0) + u_skylight * (0.62 + 0.38 * n.z);
#ifdef DULL
  vec4 leaf = texture(u_noise, v_world.xy * 0.29 + v_world.z * vec2(0.19, 0.23));
  float green = clamp(8.0 * (v_colour.g / max(v_colour.r, 0.001) - 1.1), 0.0, 1.0);
  if (dot(n, v) < 0.55 * green * (leaf.b - 0.30)) discard;
  vec3 c = v_colour.rgb * light * mix(0.85 + 0.3 * leaf.b, 0.45 + 1.1 * leaf.b, green);
#else
  vec3 h = normalize(v + u_sun);
  float shine = pow(max(dot(n, h), 0.0), 40.0) * v_colour.a;
  vec3 c = v_colour.rgb * light + sun * shine * 0.6 + sky_of(reflect(-v, n)) * v_colour.a * 0.08;
#endif
  o_colour = developed(fogged(c, range, max(v.z, 0.0)));
  o_id = v_id;
  o_depth = -dot(to_eye, u_axis);
}
