// What lies below the horizon beyond all that is drawn.
#include "common.glsl"
in vec2 in_corner;
void main() {
  gl_Position = vec4(in_corner * 3.0, 1.0, 1.0);
}
