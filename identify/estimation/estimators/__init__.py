"""Estimators behind one interface: a function from a `Problem` to an `Estimate`, each in a file of its own."""
