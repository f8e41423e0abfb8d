"""Studies that choose: options, losses, real arms. They read the session and write tables; speed is in benchmarks/."""
