// Any number of workgroups as an indirect dispatch whose dimensions are limited.
Groups spread(uint groups, uint max_groups) {
  Groups g;
  g.x = min(groups, max_groups);
  g.y = g.x == 0u ? 0u : (groups + g.x - 1u) / g.x;
  g.z = 1u;
  return g;
}
