"""The Unity package: the importer's rules and frame, the manifest, the files, and the way back."""
