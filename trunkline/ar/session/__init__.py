"""A session over the network: page and robot on either side of a server that decides everything."""
