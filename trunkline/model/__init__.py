"""The arm as MuJoCo has it: how it is built, what its statics are, how it is simulated."""
