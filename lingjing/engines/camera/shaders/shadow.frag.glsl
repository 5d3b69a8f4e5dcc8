uniform float u_shade_left;
layout(location = 0) out vec4 o_colour;
void main() { o_colour = vec4(0.0, 0.0, 0.0, u_shade_left); }
