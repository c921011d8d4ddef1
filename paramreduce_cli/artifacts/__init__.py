"""Files between stages: the only place that touches HDF5."""
