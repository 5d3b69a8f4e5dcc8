// Light, fog and the place in the shadow map are values of vertices: a software renderer pays for a pixel of every small
// triangle as for sixteen, and a mesh has few vertices for its pixels.
#include "common.glsl"
in vec3 in_position, in_normal;
in vec4 in_colour;
in vec4 in_row0, in_row1, in_row2;
in float in_plane;
in uint in_id;
out vec3 v_sunned, v_rest;    // what a pixel adds to the picture by sunlight, and without it
flat out uint v_id;
#ifdef SHADED
out vec3 v_shade;
#endif
#ifdef DULL
out vec2 v_leaf;              // place in the noise
out vec3 v_rim;               // how far the surface faces the eye, and below what noise it ends; strength of the mottle
#endif
const float GLOWING = 2.2;    // linear light of a white surface whose own light is 1: a sunlit wall, before it is developed
const float TURNED = -0.5;    // a normal that faces away farther than this belongs to the back of a thin thing
void main() {
  vec4 p = vec4(in_position, 1.0);
  vec3 world = vec3(dot(in_row0, p), dot(in_row1, p), dot(in_row2, p));
  vec3 n = normalize(vec3(dot(in_row0.xyz, in_normal), dot(in_row1.xyz, in_normal), dot(in_row2.xyz, in_normal)));
  vec3 to_eye = u_eye - world;
  float range = length(to_eye);
  vec3 v = to_eye / max(range, 1e-6);
  float facing = dot(n, v);
  n = facing < TURNED ? -n : normalize(n - min(facing, 0.0) * v);
  vec3 sun = in_colour.rgb * max(dot(n, u_sun), 0.0), rest = in_colour.rgb * u_skylight * (0.62 + 0.38 * n.z);
  rest += in_colour.rgb * max(-in_colour.a, 0.0) * GLOWING;
  float kept = exp2(-u_fog * range);
#ifdef DULL
  float green = clamp(8.0 * (in_colour.g / max(in_colour.r, 0.001) - 1.1), 0.0, 1.0);
  v_leaf = world.xy * 0.29 + world.z * vec2(0.19, 0.23);
  v_rim = vec3(facing, 0.55 * green, mix(0.3, 1.1, green) * kept);
#else
  float gloss = max(in_colour.a, 0.0);
  float shine = pow(max(dot(n, normalize(v + u_sun)), 0.0), 40.0) * gloss;
  sun += shine * 0.6;
  rest += sky_of(reflect(-v, n)) * gloss * 0.08;
#endif
  v_sunned = u_sunlight * sun * kept;
  v_rest = rest * kept + u_haze * (1.0 - 0.6 * max(v.z, 0.0)) * (1.0 - kept);
  v_id = in_id;
#ifdef SHADED
  v_shade = (u_shade * vec4(world + (n + 0.8 * u_sun) * u_shade_step, 1.0)).xyz;
#endif
  gl_Position = u_clip * vec4(world - u_eye, 1.0);
}
