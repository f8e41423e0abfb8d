"""What a lab may trust the twin with: the uncertainty of the tip at rest, and the certificate that says so."""
