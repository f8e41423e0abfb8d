"""Work on this machine or on others: threads, processes, progress, the scheduler, and what a process computes with."""
