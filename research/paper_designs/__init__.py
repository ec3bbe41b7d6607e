"""The paper's experiment (Park et al. 2020, Table 1) at a scale that can show its number of pairs; see README."""
