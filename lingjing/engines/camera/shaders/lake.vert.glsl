#include "common.glsl"
in vec3 in_position;
void main() { gl_Position = u_clip * vec4(in_position - u_eye, 1.0); }
