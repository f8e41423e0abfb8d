"""Plans on real machines: the tendons' motors on a CAN bus, the Panda behind an adapter, both on one clock."""
