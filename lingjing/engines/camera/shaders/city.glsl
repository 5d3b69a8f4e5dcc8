// What the fragments of a town share. Vertices are `mesh_rows.VERTEX`. A software renderer pays for every branch and every
// texture read, so each material is a program of its own, with wet and night code in it only when it rains or is dark.
// Detail that a pixel cannot hold fades into its mean: line and window edges are box-filtered with fwidth; where no pixel
// holds any, BLUNT variants know the mean alone. EVEN variants leave out the grain.
#include "common.glsl"
#include "outputs.glsl"
#ifdef WET
uniform float u_rain, u_snow;
#endif
uniform sampler2D u_grain;    // tone of paving, bare patches, tone of asphalt, wear of paint; `GRAIN_M` across
uniform sampler2D u_paved, u_street, u_tone;  // the first two of them, the last two, the tone of asphalt: fewer bytes
const float GRAIN_M = 64.0, MEAN_GRAIN = 0.537;
in vec3 v_world;
flat in vec3 v_normal, v_sunned;
flat in vec4 v_colour, v_style;
flat in float v_layer;
flat in uint v_id;
in vec2 v_at;
#ifdef SUNLIT
uniform sampler2DShadow u_shadow;
in vec3 v_shade;
float sunny() { return texture(u_shadow, v_shade); }
#else
#ifdef AVERTED
float sunny() { return 0.0; }
#else
float sunny() { return 1.0; }
#endif
#endif
float hash(vec2 p, float seed) {
  vec3 q = fract(vec3(p.xyx + seed * 0.37) * vec3(0.1031, 0.1030, 0.0973));
  q += dot(q, q.yzx + 33.33);
  return fract((q.x + q.y) * q.z);
}
