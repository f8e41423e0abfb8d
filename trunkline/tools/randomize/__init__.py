"""What identification left open of an arm, or what differs between arms, for simulators that learn: domain
randomisation."""
