"""The search for parameters: problem, optimizers, and how sure the result is."""
