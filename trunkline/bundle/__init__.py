"""The twin as a Unity package: checked against what Unity imports, described, packed, and loaded back."""
