"""How far a model is from the measurements, beside a model that knows nothing and the arm's own noise."""
