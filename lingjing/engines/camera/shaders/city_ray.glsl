  vec3 v = u_eye - v_world;
  float range2 = dot(v, v), closeness = inversesqrt(range2), range = range2 * closeness;
  v *= closeness;
