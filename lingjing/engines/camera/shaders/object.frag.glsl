#include "common.glsl"
#include "outputs.glsl"
in vec3 v_sunned, v_rest;
flat in uint v_id;
#ifdef SHADED
in vec3 v_shade;
#endif
#ifdef DULL
uniform sampler2D u_noise;
in vec2 v_leaf;
in vec3 v_rim;
#endif
void main() {
#ifdef DULL
  float leaf = texture(u_noise, v_leaf).b;
  if (abs(v_rim.x) < v_rim.y * (leaf - 0.30)) discard;
#endif
#ifdef SHADED
  vec3 c = v_sunned * texture(u_shadow, v_shade) + v_rest;
#else
  vec3 c = v_sunned + v_rest;
#endif
#ifdef DULL
  c *= 1.0 + v_rim.z * (leaf - 0.5);
#endif
  o_colour = developed(c);
  o_id = v_id;
  o_depth = 1.0 / gl_FragCoord.w;
}
