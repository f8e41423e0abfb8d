"""Parameters that can be identified: what each changes in a model, and how it is written back."""
