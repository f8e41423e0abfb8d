"""One way to rest and one way to move, in batches of simulations."""
