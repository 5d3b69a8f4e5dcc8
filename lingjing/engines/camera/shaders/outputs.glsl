// RGBA8 colour (tone-mapped, gamma 2; alpha 1), R16UI id, R32F metres along the optical axis.
layout(location = 0) out vec4 o_colour;
layout(location = 1) out uint o_id;
layout(location = 2) out float o_depth;
