// SURFACE is the class id: 2 sand, 3 grass, 4 rock, 5 concrete; a branch costs a software renderer both its sides.
#include "common.glsl"
#include "outputs.glsl"
uniform sampler2D u_noise;
in vec3 v_world, v_normal;
in vec4 v_colour;
flat in uint v_id;
void main() {
  vec3 to_eye = u_eye - v_world;
  float range = length(to_eye);
  vec3 n = normalize(v_normal);
  vec4 wide = texture(u_noise, v_world.xy / 131.0);
  vec4 fine = texture(u_noise, mat2(0.86, 0.5, -0.5, 0.86) * v_world.xy / 37.0 + v_world.z * 0.02);
  vec3 c = v_colour.rgb * (0.72 + 0.30 * wide.r + 0.26 * fine.g) * (0.93 + 0.14 * fine.b);
  float over = v_world.z - u_level;
  if (SURFACE == 2) {
    c *= mix(0.45, 1.0, smoothstep(0.15, 0.75, over + 0.25 * (wide.g - 0.5)));
    float tangle = smoothstep(0.60, 0.80, fine.r * 0.6 + wide.g * 0.45);
    c = mix(c, vec3(0.14, 0.14, 0.06), 0.6 * tangle * smoothstep(0.9, 1.5, over));
    c = mix(c, vec3(0.10, 0.08, 0.05), 0.5 * smoothstep(0.10, 0.0, abs(over - 0.95 - 0.3 * (wide.r - 0.5))) * fine.b);
  } else if (SURFACE == 3) {
    c = mix(c, vec3(0.20, 0.18, 0.075), smoothstep(0.45, 0.8, wide.g) * 0.75);
    c = mix(c, vec3(0.17, 0.155, 0.13), smoothstep(0.90, 0.80, n.z));
    c *= 0.8 + 0.4 * fine.b;
  } else if (SURFACE == 4) {
    c *= 0.65 + 0.75 * fine.r;
    c = mix(c * 0.45, c, smoothstep(0.2, 1.1, over + 0.6 * (fine.g - 0.5)));
    c = mix(c, vec3(0.09, 0.115, 0.045), smoothstep(0.55, 0.75, wide.r) * smoothstep(3.0, 5.0, over));
  } else {
    vec2 joint = abs(fract(v_world.xy / 6.0) - 0.5);
    float seam = smoothstep(0.488, 0.496, max(joint.x, joint.y)) * step(0.5, n.z);
    c *= (1.0 - 0.35 * seam) * (0.9 + 0.2 * fine.b);
    c = mix(vec3(0.045, 0.055, 0.035), c, smoothstep(0.2, 1.2, over + (wide.g - 0.5)));
  }
  vec3 light = u_sunlight * sunlit(v_world, n) * max(dot(n, u_sun), 0.0) + u_skylight * (0.62 + 0.38 * n.z);
  o_colour = developed(fogged(c * light, range, max(to_eye.z / range, 0.0)));
  o_id = v_id;
  o_depth = -dot(to_eye, u_axis);
}
