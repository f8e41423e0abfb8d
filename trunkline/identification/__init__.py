"""Identification: measured trials and a model in, the model's parameters with their certainty out."""
