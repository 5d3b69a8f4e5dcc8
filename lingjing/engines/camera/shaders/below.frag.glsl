#include "common.glsl"
#include "outputs.glsl"
uniform vec4 u_floor;          // its colour; 1 for water
uniform vec2 u_floor_is;       // elevation, class id
void main() {
  vec3 ray = ray_of(gl_FragCoord.xy);
  if (ray.z >= 0.0) discard;
  float depth = (u_floor_is.x - u_eye.z) / ray.z;
  float range = depth * length(ray);
  vec3 d = ray * (depth / range);
  vec3 c = u_floor.rgb * (mix(u_sun.z, 0.35, u_floor.a) * u_sunlight + u_skylight);
  float f = 1.0 + d.z;
  c += u_floor.a * sky_of(vec3(d.xy, -d.z)) * (0.022 + 0.978 * f * f * f * f * f);
  o_colour = developed(fogged(c, range, -d.z));
  o_id = uint(u_floor_is.y);
  o_depth = depth;
}
