"""Which parameters trials can identify, what a fit without some of them is, and which trials look wrong."""
