"""The dynamics of a mechanism: kinematics, IDM, DDM, regressor, base parameters."""
