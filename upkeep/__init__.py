"""Tools that look after this repository. No part of the product: nothing in trunkline/ imports them."""
