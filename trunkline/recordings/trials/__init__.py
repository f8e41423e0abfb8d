"""What a trial is: its kind, when it begins, as recorded (raw trial) and as filtered (trial), and their tables."""
