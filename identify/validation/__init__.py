"""Held-out logs, and cross-checks against Pinocchio and MuJoCo."""
