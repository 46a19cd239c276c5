"""Argument parsing and progress; no mathematics."""
