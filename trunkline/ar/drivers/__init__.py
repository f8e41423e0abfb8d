"""Plans on real machines: the tendons' motors on a CAN bus, the Panda behind a driver process, both on one clock."""
