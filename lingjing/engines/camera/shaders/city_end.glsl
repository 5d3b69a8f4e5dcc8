  o_colour = developed(mix(u_haze * (1.0 - 0.6 * max(v.z, 0.0)), c, exp2(-u_fog * range)));
  o_id = v_id;
  o_depth = 1.0 / gl_FragCoord.w;
}
