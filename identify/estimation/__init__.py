"""From logs to parameters: filtering, observation matrices, estimators, statistics."""
