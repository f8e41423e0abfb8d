"""What a trial is: its kind, when it begins, as recorded (take) and as filtered (trial), and their tables."""
