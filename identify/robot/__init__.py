"""What the arm is: Robot and its readers and writers."""
