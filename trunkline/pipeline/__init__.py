"""The edge: settings and files of the stages, and the identifying stages."""
