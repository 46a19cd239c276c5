"""Torque and energy regressors at run time; needs numpy alone once generated."""
