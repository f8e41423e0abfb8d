"""What a lab may trust the twin with: the certificate and every figure."""
