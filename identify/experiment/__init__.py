"""Trajectories that excite, and the simulated robot that runs them."""
