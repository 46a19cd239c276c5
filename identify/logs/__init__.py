"""What the arm did: Log, its files and their triage."""
