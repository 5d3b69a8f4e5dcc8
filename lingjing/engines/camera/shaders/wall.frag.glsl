#include "city.glsl"
flat in vec4 v_panes;
void main() {
#ifdef BLUNT
  vec2 whole = 2.0 * v_panes.xy;
  float glass = whole.x * whole.y, far = 1.0, frame = 0.0, h = 0.5;
#else
  vec2 number = floor(v_at), at = v_at - number - 0.5, f = abs(at);
  vec2 w = fwidth(v_at) + 1e-5, sharpness = 1.0 / w;
  vec2 half_glass = number.y < 0.5 ? v_panes.zw : v_panes.xy;
  float some = float(v_panes.x > 0.005);
  vec2 edge = (half_glass - f) * sharpness + 0.5;
  vec2 pane = mix(clamp(edge, 0.0, 1.0), 2.0 * half_glass, clamp(w - 0.5, 0.0, 1.0));
  float glass = pane.x * pane.y;
  vec2 rim = clamp(edge + vec2(0.03, 0.04) * sharpness, 0.0, 1.0);
  float far = clamp((max(w.x, w.y) - 0.35) * 1.33, 0.0, 1.0);
  float frame = clamp(rim.x * rim.y * some - glass, 0.0, 1.0) * (1.0 - far);
  float h = mix(hash(number, v_layer), 0.5, far);
  float below = -at.y - half_glass.y;                // in storeys: a sill below a window, a lintel's shadow in its top
  float sill = clamp((0.045 - abs(below - 0.03)) * sharpness.y + 0.5, 0.0, 1.0) * (1.0 - far)
             * clamp((half_glass.x + 0.05 - f.x) * sharpness.x + 0.5, 0.0, 1.0) * some * (1.0 - glass);
  float shade = clamp((at.y - half_glass.y + 0.06) * sharpness.y + 0.5, 0.0, 1.0) * (1.0 - far);
  float bars = clamp((0.012 - abs(f.x - (v_panes.x < 0.3 ? 0.0 : 0.25))) * sharpness.x + 0.5, 0.0, 1.0) * glass
             * clamp(1.5 - 40.0 * w.x, 0.0, 1.0);
#endif
  float up = v_at.y * v_style.y;
#include "city_ray.glsl"
#ifdef EVEN
  float grain = MEAN_GRAIN;
#else
  float grain = texture(u_tone, (v_at * v_style.xy) * vec2(0.6, 1.1) / GRAIN_M + v_layer * 0.013).r;
#endif
  vec3 wall = v_colour.rgb * (0.80 + 0.36 * grain) * (0.72 + 0.28 * clamp(up * 0.4, 0.0, 1.0));
  wall = mix(wall, wall * 0.72 + 0.03, frame);
#ifdef BLUNT
#else
  wall = mix(wall, wall * 0.75 + 0.16, sill);
#endif
#ifdef WET
  wall *= 0.78;
#endif
  float lit = sunny();
  vec3 light = v_sunned * lit + u_skylight * (0.56 + 0.12 * clamp(up * 0.04, 0.0, 1.0));
  float facing = dot(v_normal, v);
  vec3 r = 2.0 * facing * v_normal - v;
  float k = 1.0 - max(facing, 0.0);
  k *= k;
  float fresnel = 0.05 + v_colour.a * 0.34 + 0.55 * k * k;
  vec3 mirrored = sky_of(r) * (0.34 + 0.66 * clamp((r.z + 0.10 * h + 0.20) * 3.0, 0.0, 1.0));
  vec3 body = mix(vec3(0.018, 0.026, 0.034), v_colour.rgb * 0.32, v_colour.a) * (0.55 + 0.9 * h);
  body = h > 0.78 ? mix(body, vec3(0.30, 0.28, 0.25), 0.55 * (1.0 - v_colour.a) * (1.0 - far)) : body;
  float glint = max(dot(r, u_sun), 0.0);
  glint *= glint; glint *= glint; glint *= glint; glint *= glint; glint *= glint; glint *= glint;
  vec3 pane_light = body * light * 1.1 + mirrored * fresnel + u_sunlight * (lit * glint * 0.5);
#ifdef BLUNT
#else
  pane_light = mix(pane_light * (1.0 - 0.5 * shade), vec3(0.50) * light, bars);
#endif
  vec3 c = mix(wall * light, pane_light, glass);
#ifdef NIGHT
#ifdef BLUNT
  float on = 0.38;
#else
  float on = mix(step(hash(number + 17.0, v_layer + 3.0), 0.38), 0.38, far);
#endif
  vec3 lamp = mix(vec3(0.95, 0.62, 0.30), vec3(0.80, 0.84, 0.90), step(0.6, fract(h * 7.3)));
  c += lamp * on * glass * u_dark * (0.25 + 0.5 * h) + wall * vec3(0.20, 0.15, 0.09) * u_dark * exp2(-up * 0.25);
#endif
#include "city_end.glsl"
