"""A robot's models as source code that a controller carries along: C99 and Python."""
